// SPDX-License-Identifier: BSD-3-Clause
// What several publishers of one topic say, each for itself: the word of one does not take back that of another. No ROS.
#pragma once

#include <algorithm>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace kurumaisu {

/// Who says something.
struct Speaker {
  std::string name;
  std::function<bool()> is_there{};  ///< whether it can still take back what it says; nothing: it can
};

inline bool isThere(const Speaker& speaker) { return !speaker.is_there || speaker.is_there(); }

/// The last word of each: whether it holds the chair. A word of somebody who is gone stands until anybody says something.
class Words {
 public:
  void hear(const Speaker& by, bool holds, double t) {
    forget([&by](const Word& word) { return word.by.name == by.name || !isThere(word.by); });
    words_.push_back({by, holds, t});
  }

  bool anyHolds() const {
    return std::any_of(words_.begin(), words_.end(), [](const Word& word) { return word.holds; });
  }

  /// Names of those who hold it and could let it go: "/a, /b"; "" for none.
  std::string holders() const {
    std::string names;
    for (const Word& word : words_) {
      if (word.holds && isThere(word.by)) names += (names.empty() ? "" : ", ") + word.by.name;
    }
    return names;
  }

  /// When he spoke last who has been silent for longest [s]; none: nobody spoke since the clock ran backwards.
  std::optional<double> oldest() const {
    std::optional<double> oldest;
    for (const Word& word : words_) {
      if (!word.t) return std::nullopt;
      oldest = std::min(oldest.value_or(*word.t), *word.t);
    }
    return oldest;
  }

  bool empty() const { return words_.empty(); }

  void forgetGone() {
    forget([](const Word& word) { return !isThere(word.by); });
  }

  /// After the clock ran backwards nobody knows how old anything is.
  void forgetTimes() {
    for (Word& word : words_) word.t.reset();
  }

 private:
  struct Word {
    Speaker by;
    bool holds;
    std::optional<double> t;  ///< [s]
  };

  template <typename Which>
  void forget(const Which& which) {
    words_.erase(std::remove_if(words_.begin(), words_.end(), which), words_.end());
  }

  std::vector<Word> words_;
};

}  // namespace kurumaisu
