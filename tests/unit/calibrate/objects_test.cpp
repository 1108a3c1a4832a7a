// dtact-calibrate objects: evaluate on drawn presses of a ball and of a plate's corner; a lesson; a
// folder of taught objects with damaged files.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "clients/calibrate/calibrate.hpp"
#include "clients/calibrate/objects/teaching.hpp"
#include "clients/common/depth_file.hpp"
#include "clients/perceive/recognition/taught_objects.hpp"
#include "clients/recording/recording_writer.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/files/mcap_file_sink.hpp"
#include "hal/files/png.hpp"
#include "tests/unit/calibration/sample.hpp"
#include "tests/unit/client/played_daemon.hpp"

namespace dtact::objects {
namespace {

using testing::AllOf;
using testing::DoubleNear;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr int kWidth = 125;  // 500 x 400 at a quarter of 0.0417 mm
constexpr int kHeight = 100;
constexpr double kMmPerPx = 4 * 0.0417;

using Shape = std::function<double(double x_mm, double y_mm)>;

Shape ball(double radius_mm) {
  return [=](double x, double y) {
    const double r = std::hypot(x, y);
    return r < radius_mm ? 1 - radius_mm + std::sqrt(radius_mm * radius_mm - r * r) : 0;
  };
}
double corner(double x, double y) { return x > -2 && x < 3 && y > -1.5 && y < 4 ? 0.9 : 0; }

/// Millimetres, with the shape's middle at (x, y) pixels.
std::vector<float> map_of(const Shape& shape, int x, int y) {
  std::vector<float> mm;
  for (int row = 0; row < kHeight; ++row) {
    for (int column = 0; column < kWidth; ++column) {
      mm.push_back(
          static_cast<float>(std::max(0.0, shape(kMmPerPx * (column - x), kMmPerPx * (row - y)))));
    }
  }
  return mm;
}

v1::DepthMap message_of(const std::vector<float>& mm) {
  v1::DepthMap map;
  map.set_encoding(v1::DEPTH_INT16);
  map.set_width(kWidth);
  map.set_height(kHeight);
  map.set_full_width(kWidth);
  map.set_full_height(kHeight);
  map.set_mm_per_px(kMmPerPx);
  map.set_um_per_unit(1);
  for (const float value : mm) {
    const auto um = static_cast<unsigned>(std::lround(1000 * value));
    map.mutable_data()->push_back(static_cast<char>(um & 0xFFU));
    map.mutable_data()->push_back(static_cast<char>(um >> 8U));
  }
  return map;
}

class Evaluate : public testing::Test {
 protected:
  [[nodiscard]] std::string at(const std::string& name) const {
    return (temp_.path() / name).string();
  }
  void write_map(const std::string& name, const std::vector<float>& mm) const {
    std::filesystem::create_directories(std::filesystem::path(at(name)).parent_path());
    base::write_file_atomically(
        at(name), cli::encode_npy({kWidth, kHeight, kMmPerPx, std::span<const float>(mm)}));
  }
  /// Each press is 0.3 s of contact, and a frame without contact after it.
  void write_recording(const std::string& name, const std::vector<std::vector<float>>& presses) {
    std::filesystem::create_directories(std::filesystem::path(at(name)).parent_path());
    mcap::FileSink sink(at(name), true);
    recording::RecordingWriter writer(sink, {.program = "test"});
    std::uint64_t sequence = 0;
    for (const std::vector<float>& mm : presses) {
      for (int i = 0; i < 19; ++i) {
        v1::Frame frame;
        frame.set_sequence(++sequence);
        frame.set_wall_ns(static_cast<std::int64_t>(sequence) * 16'666'667);
        frame.set_monotonic_ns(frame.wall_ns());
        frame.mutable_contact()->set_in_contact(i < 18);
        *frame.mutable_depth() = message_of(mm);
        writer.add(frame);
      }
    }
    writer.finish();
  }
  int run(std::vector<std::string> options = {}) {
    options.insert(options.begin(), {"objects", "evaluate", at("presses")});
    std::ostringstream out;
    std::ostringstream error;
    const int code = calibrate::run(options, out, error);
    said_ = out.str() + error.str();
    return code;
  }

  std::string said_;

 private:
  const calibration::TempFolder temp_;
};

TEST_F(Evaluate, SaysBothSplitsAndDrawsTheTable) {
  write_recording("presses/ball/1.mcap",
                  {map_of(ball(4), 50, 40), map_of(ball(4), 71, 52), map_of(ball(4), 60, 61)});
  write_map("presses/plate/left/1.npy", map_of(corner, 55, 45));
  write_map("presses/plate/left/2.npy", map_of(corner, 63, 47));
  write_map("presses/plate/right/1.npy", map_of(corner, 70, 50));
  // As file managers and version control leave them.
  base::write_file_atomically(at("presses/plate/left/._1.npy"), "hidden");
  std::filesystem::create_directory(at("presses/.git"));
  ASSERT_EQ(run({"--mm-per-px", "0.1668", "-o", at("table.png")}), 0) << said_;
  EXPECT_THAT(said_, HasSubstr("ball: 3 presses or objects\nplate: 2 presses or objects\n"));
  // Three contacts of three frames, and three maps.
  EXPECT_THAT(said_, HasSubstr("in the paper: 1.000 of 4\n"));
  EXPECT_THAT(said_, HasSubstr("as a new press: 1.000 of 12\n"));
  EXPECT_THAT(said_, HasSubstr("ball is named ball 100 %\nplate is named plate 100 %\n"));
  const auto header = image::png_header(base::read_file(at("table.png")), "table.png");
  EXPECT_GT(header.width, 200);
  EXPECT_FALSE(header.grey);
}

// A press that looks like nothing else of its name is not known by its own frames.
TEST_F(Evaluate, APressIsKnownByOtherPressesOnly) {
  write_recording("presses/ball/1.mcap", {map_of(ball(4), 50, 40), map_of(corner, 71, 52)});
  write_map("presses/plate/1.npy", map_of(corner, 55, 45));
  write_map("presses/plate/2.npy", map_of(corner, 63, 47));
  ASSERT_EQ(run({"--mm-per-px", "0.1668"}), 0) << said_;
  EXPECT_THAT(said_, testing::Not(HasSubstr("as a new press: 1.000")));
}

TEST_F(Evaluate, ARecordingThatEndsEarlyIsUsedAndNamed) {
  write_recording("presses/ball/1.mcap", {map_of(ball(4), 50, 40), map_of(ball(4), 71, 52)});
  const std::string whole = base::read_file(at("presses/ball/1.mcap"));
  base::write_file_atomically(at("presses/ball/2.mcap"), whole.substr(0, whole.size() - 20));
  write_map("presses/plate/1.npy", map_of(corner, 55, 45));
  write_map("presses/plate/2.npy", map_of(corner, 63, 47));
  ASSERT_EQ(run({"--mm-per-px", "0.1668"}), 0) << said_;
  EXPECT_THAT(said_, HasSubstr("warning: " + at("presses/ball/2.mcap") +
                               ": not all of it could be read ("));
  base::write_file_atomically(at("presses/ball/2.mcap"), whole.substr(0, 200));
  EXPECT_NE(run({"--mm-per-px", "0.1668"}), 0);
  EXPECT_THAT(said_, HasSubstr(at("presses/ball/2.mcap") + ": "));
}

TEST_F(Evaluate, WhatItCannotUseIsNamed) {
  EXPECT_NE(run(), 0);
  EXPECT_THAT(said_, HasSubstr(at("presses") + ": there is no such folder"));
  write_map("presses/ball/1.npy", map_of(ball(4), 50, 40));
  EXPECT_NE(run(), 0);
  EXPECT_THAT(said_, HasSubstr(at("presses") + ": two objects are needed at least"));
  write_map("presses/plate/1.npy", map_of(corner, 50, 40));
  EXPECT_NE(run(), 0);
  EXPECT_THAT(said_, HasSubstr(at("presses/ball/1.npy") + ": has no scale: give --mm-per-px"));
  EXPECT_NE(run({"--mm-per-px", "0.1668"}), 0);
  EXPECT_THAT(said_, HasSubstr(at("presses/ball") + ": two presses of 0.3 mm and more are needed"));
  const std::string whole = base::read_file(at("presses/ball/1.npy"));
  base::write_file_atomically(at("presses/ball/1.npy"), whole.substr(0, whole.size() - 4));
  EXPECT_NE(run({"--mm-per-px", "0.1668"}), 0);
  EXPECT_THAT(said_, HasSubstr(at("presses/ball/1.npy") + ": is no array"));
  write_recording("presses/ball/1.mcap", {map_of(ball(4), 50, 40)});
  base::write_file_atomically(at("presses/ball/1.npy"),
                              cli::npy_head("(3,)") + cli::npy_values(std::vector<float>{1, 2, 3}));
  EXPECT_NE(run({"--mm-per-px", "0.1668"}), 0);
  EXPECT_THAT(said_, HasSubstr(at("presses/ball/1.npy") + ": is no depth map"));
}

class Silent : public ctl::guided::Console {
 public:
  [[nodiscard]] bool interactive() const override { return false; }
  [[nodiscard]] ctl::guided::Typed typed() override { return {}; }
  [[nodiscard]] bool interrupted() const override { return false; }
  void say(const std::string&) override {}
  void keep(const image::Grey8&) override {}
  void live(const ctl::guided::Scene&) override {}
};

TEST(Teaching, KeepsThePressesWhileTheDaemonRestarts) {
  const auto press = [](client::test::Peer& peer, int x) {
    v1::ServerMessage message;
    v1::Frame& frame = *message.mutable_frame();
    frame.mutable_contact()->set_in_contact(true);
    *frame.mutable_depth() = message_of(map_of(ball(4), x, 40));
    for (int i = 0; i < 10; ++i) peer.send(message);
    frame.mutable_contact()->set_in_contact(false);
    peer.send(message);
  };
  client::test::PlayedDaemon daemon(
      {[&](client::test::Peer& peer) {
         peer.greet();
         v1::Reply status;
         status.mutable_status()->mutable_calibration()->set_mm_per_px(kMmPerPx / 4);
         peer.answer(status);
         peer.done();
         press(peer, 50);
         press(peer, 71);
       },
       [&](client::test::Peer& peer) {
         peer.greet();
         peer.done();
         press(peer, 60);
         peer.request();  // until the end
       }});
  const calibration::TempFolder temp;
  Silent console;
  teach({.folder = temp.path(), .name = "lid", .presses = 3}, daemon.options, console);
  EXPECT_EQ(perceive::read_presses(temp.path(), "lid").size(), 3U);
}

/// Types a line after the first message that contains `after`; none where that is empty.
class Typing : public Silent {
 public:
  Typing(std::string after, std::string line) : after_(std::move(after)), line_(std::move(line)) {}

  [[nodiscard]] ctl::guided::Typed typed() override {
    if (!due_) return {};
    due_ = false;
    return {ctl::guided::Typed::Kind::line, line_};
  }
  void say(const std::string& text) override {
    said += text + "\n";
    if (after_.empty() || text.find(after_) == std::string::npos) return;
    due_ = true;
    after_.clear();
  }

  std::string said;

 private:
  std::string after_;
  std::string line_;
  bool due_ = false;
};

/// Teaches the name lid with presses, each a shape and its number of frames at 10 Hz; returns the
/// depths of those that were stored.
std::vector<double> taught(const std::vector<std::pair<Shape, int>>& presses, int wanted,
                           Silent& console) {
  client::test::PlayedDaemon daemon({[&](client::test::Peer& peer) {
    peer.greet();
    v1::Reply status;
    status.mutable_status()->mutable_calibration()->set_mm_per_px(kMmPerPx / 4);
    peer.answer(status);
    peer.done();
    for (const auto& [shape, frames] : presses) {
      v1::ServerMessage message;
      v1::Frame& frame = *message.mutable_frame();
      frame.mutable_contact()->set_in_contact(true);
      *frame.mutable_depth() = message_of(map_of(shape, 55, 45));
      for (int i = 0; i < frames; ++i) peer.send(message);
      frame.mutable_contact()->set_in_contact(false);
      peer.send(message);
    }
    peer.request();  // until the end
  }});
  const calibration::TempFolder temp;
  teach({.folder = temp.path(), .name = "lid", .presses = wanted}, daemon.options, console);
  std::vector<double> depths_mm;
  for (const perceive::TouchMap& press : perceive::read_presses(temp.path(), "lid")) {
    depths_mm.push_back(static_cast<double>(std::ranges::max(press.mm)));
  }
  return depths_mm;
}

/// The plate's corner, `depth_mm` deep.
Shape corner_of(double depth_mm) {
  return [=](double x, double y) { return corner(x, y) / 0.9 * depth_mm; };
}

// 0.3 mm are needed, and half a second from the first frame of a depth on: six frames.
TEST(Teaching, TakesNeitherAShallowNorAShortPress) {
  Typing console("", "");
  EXPECT_THAT(taught({{corner_of(0.28), 12},
                      {corner_of(0.6), 5},
                      {corner_of(0.7), 6},
                      {corner_of(0.8), 9},
                      {corner_of(0.9), 9}},
                     3, console),
              ElementsAre(DoubleNear(0.7, 0.01), DoubleNear(0.8, 0.01), DoubleNear(0.9, 0.01)));
  EXPECT_THAT(console.said, AllOf(HasSubstr("Press deeper: at least 0.3 mm"),
                                  HasSubstr("press 1 of 3 taken, 0.70 mm deep")));
}

TEST(Teaching, TakesTheLastPressBack) {
  Typing console("press 2 of 3 taken", "b");
  EXPECT_THAT(
      taught({{corner_of(0.5), 9}, {corner_of(0.6), 9}, {corner_of(0.7), 9}, {corner_of(0.8), 9}},
             3, console),
      ElementsAre(DoubleNear(0.5, 0.01), DoubleNear(0.7, 0.01), DoubleNear(0.8, 0.01)));
}

TEST(TaughtObjects, ADamagedFileIsListedAndForgotten) {
  const calibration::TempFolder temp;
  perceive::write_presses(temp.path(), "lid", std::vector<perceive::TouchMap>(3));
  base::write_file_atomically(temp.path() / "torn.png", "no picture");
  std::filesystem::create_directories(temp.path() / "folder.png" / "of somebody");
  const auto run = [&](std::vector<std::string> words) {
    words.insert(words.end(), {"--taught", temp.path().string()});
    std::ostringstream out;
    const int code = calibrate::run(words, out, out);
    return fmt::format("{} {}", code, out.str());
  };
  const std::string at = temp.path().string();
  EXPECT_EQ(run({"objects", "list"}),
            "0 folder: damaged: " + at + "/folder.png is not a file: forget folder, or teach it " +
                "again\nlid: 3 presses\ntorn: damaged: " + at +
                "/torn.png: not a readable PNG: it " +
                "does not begin as one: forget torn, or teach it again\n");
  EXPECT_THAT(run({"objects", "list", "--json"}), HasSubstr("forget torn, or teach it again"));
  EXPECT_EQ(run({"objects", "forget", "torn"}), "0 ");
  EXPECT_THAT(run({"objects", "forget", "folder"}), HasSubstr("remove it yourself"));
  std::filesystem::remove(temp.path() / "folder.png" / "of somebody");
  EXPECT_EQ(run({"objects", "forget", "folder"}), "0 ");
  EXPECT_EQ(run({"objects", "list"}), "0 lid: 3 presses\n");
}

TEST(TaughtObjects, ARenameKeepsWhatHasTheName) {
  const calibration::TempFolder temp;
  perceive::write_presses(temp.path(), "lid", std::vector<perceive::TouchMap>(3));
  perceive::write_presses(temp.path(), "cap", std::vector<perceive::TouchMap>(4));
  const auto rename = [&](const std::string& name, const std::string& to) {
    std::ostringstream out;
    const int code =
        calibrate::run({"objects", "rename", name, to, "--taught", temp.path().string()}, out, out);
    return fmt::format("{} {}", code, out.str());
  };
  EXPECT_THAT(rename("lid", "cap"), HasSubstr("cap exists already: forget it first"));
  EXPECT_EQ(perceive::read_presses(temp.path(), "cap").size(), 4U);
  EXPECT_EQ(rename("lid", "lid"), "0 ");
  EXPECT_EQ(rename("lid", "cover"), "0 ");
  EXPECT_EQ(perceive::taught_names(temp.path()), (std::vector<std::string>{"cap", "cover"}));
}

}  // namespace
}  // namespace dtact::objects
