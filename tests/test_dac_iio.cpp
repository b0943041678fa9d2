// SPDX-License-Identifier: BSD-3-Clause
// The IIO back end on a tree of files that looks like sysfs: as the drivers mcp4728 and ad5592r lay it out.
#include <gtest/gtest.h>
#include <sys/inotify.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "dac_rig.h"

namespace test_dac_iio {

namespace d = kurumaisu::dac;
namespace fs = std::filesystem;
using d::complaint;
using d::has;

namespace {

/// A chip of four outputs, with a scale for each, or one for all.
struct Tree {
  explicit Tree(const d::Edits& edits = {}, const std::string& preset = "mcp4728.yaml") {
    chip("iio:device0", "adc_of_something");
    chip("iio:device1", preset.substr(0, preset.find('.')));
    d::Edits all{{"root: /sys/bus/iio/devices", "root: " + (folder / "devices")}};
    all.insert(all.end(), edits.begin(), edits.end());
    device = d::readDevice(written(folder, "device.yaml", d::edited(d::textOf(d::shipped(preset)), all)));
  }

  void chip(const std::string& directory, const std::string& name) const {
    const std::string place = "devices/" + directory;
    fs::create_directories(folder / place);
    put(place + "/name", name);
    if (name == "ad5592r") put(place + "/out_voltage_scale", "1.220703125");
    for (int i = 0; i < 4; ++i) {
      const std::string output = place + "/out_voltage" + std::to_string(i);
      put(output + "_raw", "4095");  // whatever it held
      if (name != "ad5592r") put(output + "_scale", "1.220703");
      if (name != "ad5592r") put(output + "_powerdown", "1");
    }
  }

  void put(const std::string& name, const std::string& text) const { d::written(folder, name, text + "\n"); }
  std::string get(const std::string& name) const {
    return d::textOf(folder / ("devices/iio:device1/" + name));
  }
  std::string raw(int output) const { return get("out_voltage" + std::to_string(output) + "_raw"); }
  std::string file(const std::string& name) const { return folder / ("devices/iio:device1/" + name); }

  d::Folder folder;
  d::Device device;
};

constexpr double kScale = 1.220703e-3;  // [V] of a code

std::string faultOf(d::Converter& converter, const d::Volts& volts) {
  return complaint<d::Fault>([&] { converter.put(volts); });
}

}  // namespace

TEST(DacIio, AVanishedDeviceIsAFaultUntilItIsBack) {
  Tree tree;
  const auto converter = d::open(tree.device);
  converter->put(d::kMoving);
  fs::remove_all(tree.folder / "devices/iio:device1");
  const std::string fault = faultOf(*converter, d::kNeutral);
  EXPECT_TRUE(has(fault, "DAC_CLOSED") && has(fault, "out_voltage2_raw")) << fault;
  EXPECT_TRUE(has(complaint<d::Fault>([&] { converter->reopen(); }), "DAC_NO_PORT"));
  EXPECT_TRUE(has(faultOf(*converter, d::kNeutral), "opened again"));
  tree.chip("iio:device1", "mcp4728");
  converter->reopen();
  converter->put(d::kNeutral);
  EXPECT_EQ(tree.raw(0), "2048\n");
}

TEST(DacIio, AnotherDeviceUnderTheSameNameIsNotDrivenUnasked) {
  const d::Edits unread{{"read_back: true", "read_back: false"}};
  Tree tree(unread);
  const auto converter = d::open(tree.device);
  fs::remove_all(tree.folder / "devices/iio:device1");
  tree.chip("iio:device1", "mcp4728");
  EXPECT_TRUE(has(faultOf(*converter, d::kNeutral), "DAC_CLOSED"));
  EXPECT_EQ(tree.raw(0), "4095\n");
}

TEST(DacIio, AllIsWrittenThoughTheReferenceFails) {
  Tree tree;
  const auto converter = d::open(tree.device);
  converter->put(d::kMoving);
  fs::remove(tree.file("out_voltage2_raw"));
  const std::string fault = faultOf(*converter, d::kNeutral);
  EXPECT_TRUE(has(fault, "DAC_CLOSED") && has(fault, "out_voltage2_raw")) << fault;
  EXPECT_EQ(tree.raw(0), "2048\n");
  EXPECT_EQ(tree.raw(1), "2048\n");
}

TEST(DacIio, WhatIsReadBackMustBeWhatWasWritten) {
  Tree tree;
  fs::remove(tree.file("out_voltage1_raw"));
  fs::create_symlink("/dev/null", tree.file("out_voltage1_raw"));  // takes everything, holds nothing
  const auto converter = d::open(tree.device);
  const std::string fault = faultOf(*converter, d::kMoving);
  EXPECT_TRUE(has(fault, "DAC_WRONG_REPLY") && has(fault, "steering")) << fault;
  const d::Edits unread{{"read_back: true", "read_back: false"}};
  Tree trusting(unread);
  fs::remove(trusting.file("out_voltage1_raw"));
  fs::create_symlink("/dev/null", trusting.file("out_voltage1_raw"));
  EXPECT_EQ(faultOf(*d::open(trusting.device), d::kMoving), "");
}

TEST(DacIio, AWriteThatTheKernelRefusesIsAFault) {
  Tree tree;
  const auto converter = d::open(tree.device);
  fs::remove(tree.file("out_voltage0_raw"));
  fs::create_symlink("/dev/full", tree.file("out_voltage0_raw"));
  const std::string fault = faultOf(*converter, d::kMoving);
  EXPECT_TRUE(has(fault, "DAC_REFUSED") && has(fault, "out_voltage0_raw")) << fault;
}

TEST(DacIio, ASecondOwnerIsRefused) {
  Tree tree;
  auto converter = d::open(tree.device);
  EXPECT_TRUE(has(complaint<d::Fault>([&] { d::open(tree.device); }), "DAC_IN_USE"));
  converter.reset();
  EXPECT_NO_THROW(d::open(tree.device));
}

TEST(DacIio, NoDeviceOrTwoOfThem) {
  Tree tree;
  fs::remove_all(tree.folder / "devices/iio:device1");
  EXPECT_TRUE(has(complaint<d::Fault>([&] { d::open(tree.device); }), "has the name mcp4728"));
  tree.chip("iio:device1", "mcp4728");
  tree.chip("iio:device2", "mcp4728");
  const std::string fault = complaint<d::Fault>([&] { d::open(tree.device); });
  EXPECT_TRUE(has(fault, "iio:device1") && has(fault, "iio:device2")) << fault;
  const d::Edits by_folder{{"device: mcp4728", "device: " + (tree.folder / "devices/iio:device2")}};
  Tree other(by_folder);
  d::open(other.device)->put(d::kNeutral);
  EXPECT_EQ(d::textOf(tree.folder / "devices/iio:device2/out_voltage0_raw"), "2048\n");
  EXPECT_EQ(tree.raw(0), "4095\n");
}

TEST(DacIio, ARangeThatIsTooSmallIsRefused) {
  Tree tree;
  for (int i = 0; i < 4; ++i)
    tree.put("devices/iio:device1/out_voltage" + std::to_string(i) + "_scale", "0.5");
  const std::string message = complaint<std::invalid_argument>([&] { d::open(tree.device); });
  EXPECT_TRUE(has(message, tree.device.file) && has(message, "reference") && has(message, "4095")) << message;
  EXPECT_EQ(tree.raw(2), "4095\n") << "and nothing was written";
}

TEST(DacIio, SenselessAttributesAreRefused) {
  for (const char* scale : {"", "nan", "inf", "0", "-1", "1.2 V", "12e999"}) {
    Tree tree;
    tree.put("devices/iio:device1/out_voltage0_scale", scale);
    EXPECT_TRUE(has(complaint<d::Fault>([&] { d::open(tree.device); }), "DAC_REFUSED")) << scale;
  }
  Tree tree;
  fs::remove(tree.file("out_voltage0_scale"));
  EXPECT_TRUE(has(complaint<d::Fault>([&] { d::open(tree.device); }), "out_voltage0_scale"));
}

TEST(DacIio, OpeningWritesNothingAndVoltagesComeBeforePower) {
  Tree tree;
  const auto converter = d::open(tree.device);
  EXPECT_EQ(tree.raw(2), "4095\n");
  EXPECT_EQ(tree.get("out_voltage2_powerdown"), "1\n");
  const int watch = inotify_init1(IN_NONBLOCK);
  inotify_add_watch(watch, tree.file("").c_str(), IN_CLOSE_WRITE);
  converter->put(d::kNeutral);
  std::array<char, 4096> events{};
  const ssize_t size = ::read(watch, events.data(), events.size());
  close(watch);
  std::vector<std::string> written;
  for (ssize_t at = 0; at < size;) {
    const auto* event = reinterpret_cast<const inotify_event*>(&events.at(static_cast<std::size_t>(at)));
    written.emplace_back(event->name);
    at += static_cast<ssize_t>(sizeof(inotify_event)) + event->len;
  }
  EXPECT_EQ(written, (std::vector<std::string>{"out_voltage2_raw", "out_voltage0_raw", "out_voltage1_raw",
                                               "out_voltage2_powerdown", "out_voltage0_powerdown",
                                               "out_voltage1_powerdown"}));
  EXPECT_EQ(tree.get("out_voltage2_powerdown"), "0\n");
  EXPECT_EQ(tree.get("out_voltage3_powerdown"), "1\n") << "not ours";
}

TEST(DacIio, HoldsTheNearestCode) {
  for (const char* preset : {"mcp4728.yaml", "ad5592r.yaml"}) {
    Tree tree({}, preset);
    const auto converter = d::open(tree.device);
    const d::Volts held = converter->put(d::kMoving);
    EXPECT_EQ(tree.raw(2), "2048\n") << "2.5 V / 1.220703 mV";
    EXPECT_EQ(tree.raw(0), "2458\n") << "0.5 V above";
    EXPECT_EQ(tree.raw(1), "1843\n") << "0.25 V below";
    EXPECT_EQ(tree.raw(3), "4095\n") << "not ours";
    EXPECT_NEAR(held.reference, 2048 * kScale, 1e-6);
    EXPECT_NEAR(held.translation, 410 * kScale, 1e-6);
    EXPECT_NEAR(held.steering, -205 * kScale, 1e-6);
    converter->put({1e300, -1e300, 1e300});
    EXPECT_NEAR(std::stoi(tree.raw(2)) * kScale, 2.6, kScale);
    EXPECT_LE(std::stoi(tree.raw(2)) * kScale, 2.6);
  }
}

TEST(DacIio, AnOffsetShiftsTheCodes) {
  Tree tree;
  tree.put("devices/iio:device1/out_voltage_offset", "-8");  // of all: 0 V is code 8
  d::open(tree.device)->put(d::kNeutral);
  EXPECT_EQ(tree.raw(2), "2056\n");
}

}  // namespace test_dac_iio
