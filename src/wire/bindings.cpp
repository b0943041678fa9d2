// SPDX-License-Identifier: BSD-3-Clause
// kurumaisu._core: numbers put into messages that are kept as the bytes that go over the wire, for all robots at once.
#include "bindings.h"

#include <pybind11/stl.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

namespace kurumaisu {
namespace py = pybind11;
namespace {

using Integers = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;

constexpr double kWholeTurn = 6.283185307179586;
constexpr std::int64_t kNanoseconds = 1000000000;  // in a second
constexpr std::size_t kHead = 4;                   // bytes before the header: the length of the message
constexpr std::size_t kNumber = 4, kStamp = 8, kPose = 56, kTwist = 48;  // bytes of what is put

void putStamp(unsigned char* at, std::int64_t stamp) {
  const std::uint32_t words[2] = {static_cast<std::uint32_t>(stamp / kNanoseconds),
                                  static_cast<std::uint32_t>(stamp % kNanoseconds)};
  std::memcpy(at, words, sizeof words);
}

/// Counts in the message itself, and wraps.
void putHead(unsigned char* at, std::int64_t stamp) {
  std::uint32_t number = 0;
  std::memcpy(&number, at, sizeof number);
  ++number;
  std::memcpy(at, &number, sizeof number);
  putStamp(at + kNumber, stamp);
}

void putPose(unsigned char* at, double x, double y, double heading) {
  const double values[7] = {x, y, 0, 0, 0, std::sin(heading / 2), std::cos(heading / 2)};
  std::memcpy(at, values, sizeof values);
}

void putTwist(unsigned char* at, double x, double y, double z, double turn) {
  const double values[6] = {x, y, z, 0, 0, turn};
  std::memcpy(at, values, sizeof values);
}

/// A message's bytes, which stay where they are as long as this lives.
class Message {
 public:
  explicit Message(const py::buffer& data) : bytes_(data.request(true)) {}

  unsigned char* at(std::size_t place, std::size_t size) {
    if (place + size > static_cast<std::size_t>(bytes_.size * bytes_.itemsize))
      throw std::invalid_argument("there is no room in the message at " + std::to_string(place));
    return static_cast<unsigned char*>(bytes_.ptr) + place;
  }

 private:
  py::buffer_info bytes_;
};

const double* rows(const Array& array, std::size_t n, py::ssize_t columns, const char* name) {
  if (array.ndim() == 2 && array.shape(0) == static_cast<py::ssize_t>(n) && array.shape(1) == columns)
    return array.data();
  throw std::invalid_argument(std::string(name) + " must have shape (" + std::to_string(n) + ", " +
                              std::to_string(columns) + ")");
}

class OdometryFields {
 public:
  OdometryFields(const std::vector<py::buffer>& messages, const std::vector<std::size_t>& poses,
                 const std::vector<std::size_t>& twists) {
    if (poses.size() != messages.size() || twists.size() != messages.size())
      throw std::invalid_argument("each message must have its pose and its twist");
    messages_.reserve(messages.size());
    for (std::size_t i = 0; i < messages.size(); ++i) {
      Message& message = messages_.emplace_back(messages[i]);
      places_.push_back(
          {message.at(kHead, kNumber + kStamp), message.at(poses[i], kPose), message.at(twists[i], kTwist)});
    }
  }

  void fill(std::int64_t stamp, const Array& poses, const Array& velocities) {
    const double* pose = rows(poses, places_.size(), 3, "poses");
    const double* velocity = rows(velocities, places_.size(), 3, "velocities");
    for (const Places& place : places_) {
      putHead(place.head, stamp);
      putPose(place.pose, pose[0], pose[1], pose[2]);
      putTwist(place.twist, velocity[0], velocity[1], 0, velocity[2]);
      pose += 3;
      velocity += 3;
    }
  }

  void fillChange(const Integers& stamps, const Array& now, const Array& before, const Array& spans) {
    const double* pose = rows(now, places_.size(), 4, "now");
    const double* old = rows(before, places_.size(), 4, "before");
    const auto count = static_cast<py::ssize_t>(places_.size());
    if (stamps.ndim() != 1 || stamps.size() != count || spans.ndim() != 1 || spans.size() != count)
      throw std::invalid_argument("stamps and spans must have shape (" + std::to_string(count) + ",)");
    const std::int64_t* stamp = stamps.data();
    const double* span = spans.data();
    for (const Places& place : places_) {
      putHead(place.head, *stamp++);
      putPose(place.pose, pose[0], pose[1], pose[3]);
      const double dt = *span++;
      putTwist(place.twist, (pose[0] - old[0]) / dt, (pose[1] - old[1]) / dt, (pose[2] - old[2]) / dt,
               std::remainder(pose[3] - old[3], kWholeTurn) / dt);
      pose += 4;
      old += 4;
    }
  }

 private:
  struct Places {
    unsigned char *head, *pose, *twist;
  };

  std::vector<Message> messages_;
  std::vector<Places> places_;
};

class TransformFields {
 public:
  TransformFields(const py::buffer& message, const std::vector<std::size_t>& stamps,
                  const std::vector<std::size_t>& poses)
      : message_(message) {
    for (const std::size_t place : stamps) stamps_.push_back(message_.at(place, kStamp));
    for (const std::size_t place : poses) poses_.push_back(message_.at(place, kPose));
  }

  void fill(std::int64_t stamp, const Array& poses) {
    const double* pose = rows(poses, poses_.size(), 3, "poses");
    for (unsigned char* place : stamps_) putStamp(place, stamp);
    for (unsigned char* place : poses_) {
      putPose(place, pose[0], pose[1], pose[2]);
      pose += 3;
    }
  }

 private:
  Message message_;
  std::vector<unsigned char*> stamps_, poses_;
};

}  // namespace

void bindWire(py::module_& m) {
  py::class_<OdometryFields>(
      m, "OdometryFields",
      "What changes in n messages nav_msgs/Odometry, kept as bytes with the length in front: number, stamp, "
      "pose and "
      "twist. Each counts on from the number that it holds; robots are in the plane, z is 0.")
      .def(py::init<const std::vector<py::buffer>&, const std::vector<std::size_t>&,
                    const std::vector<std::size_t>&>(),
           py::arg("messages"), py::arg("poses"), py::arg("twists"),
           "poses, twists: in which byte of its message each begins.")
      .def(
          "fill", &OdometryFields::fill, py::arg("stamp"), py::arg("poses"), py::arg("velocities"),
          "Put a stamp [ns], poses (n, 3): x, y [m], heading [rad], and velocities (n, 3): forward, leftward "
          "[m/s], turn [rad/s].")
      .def("fill_change", &OdometryFields::fillChange, py::arg("stamps"), py::arg("now"), py::arg("before"),
           py::arg("spans"),
           "Put stamps (n,) [ns], poses now (n, 4): x, y, z [m], heading [rad], and how they changed from "
           "those before (n, 4), in the axes of the map, in spans (n,) [s].");
  py::class_<TransformFields>(
      m, "TransformFields",
      "What changes in a message tf2_msgs/TFMessage, kept as bytes: the stamps of all its "
      "transforms and those n that are poses in the plane.")
      .def(py::init<const py::buffer&, const std::vector<std::size_t>&, const std::vector<std::size_t>&>(),
           py::arg("message"), py::arg("stamps"), py::arg("poses"), "In which byte each begins.")
      .def("fill", &TransformFields::fill, py::arg("stamp"), py::arg("poses"),
           "Put a stamp [ns] and poses (n, 3): x, y [m], heading [rad].");
}

}  // namespace kurumaisu
