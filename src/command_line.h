// SPDX-License-Identifier: BSD-3-Clause
// The command line of a node or program: --help, and what is wrong, need no master. src/kurumaisu/program.py is Python's.
#pragma once

#include <iostream>
#include <optional>
#include <string>
#include <vector>

namespace kurumaisu {

/// The words without those that are ROS's: roslaunch gives every node its name.
inline std::vector<std::string> wordsOf(int argc, char** argv) {
  std::vector<std::string> words;
  for (int i = 1; i < argc; ++i) {
    if (const std::string word = argv[i]; word.find(":=") == std::string::npos) words.push_back(word);
  }
  return words;
}

inline bool isHelp(const std::string& word) { return word == "--help" || word == "-h"; }

/// Says on the standard error what is wrong, then the help. Returns the exit code.
inline int misused(const std::string& what, const std::string& help) {
  std::cerr << what << "\n\n" << help;
  return 2;
}

/// For a node, which takes nothing but ROS's words: what it is to exit with at once, if so.
inline std::optional<int> answered(int argc, char** argv, const std::string& help) {
  for (const std::string& word : wordsOf(argc, argv)) {
    if (!isHelp(word)) return misused("unrecognized argument: " + word, help);
    std::cout << help << "\n"
              << "OLD:=NEW renames a topic or service, _KEY:=VALUE sets a parameter, __name:=NAME\n"
              << "the node's name.\n";
    return 0;
  }
  return std::nullopt;
}

}  // namespace kurumaisu
