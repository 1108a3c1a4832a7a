// dtactctl export, on a recording that the test makes.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pthread.h>
#include <sys/file.h>

#include <chrono>
#include <csignal>
#include <set>
#include <sstream>
#include <stop_token>
#include <thread>

#include "clients/ctl/ctl.hpp"
#include "clients/recording/recording_writer.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/files/png.hpp"
#include "tests/fakes/own_path.hpp"
#include "tests/unit/recording/sample.hpp"

namespace dtact::recording {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

class Export : public testing::Test {
 protected:
  Export() {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    mcap::FileSink sink(file_, true);
    RecordingWriter writer(sink, {.program = "test"});
    for (std::uint64_t i = 0; i < 5; ++i) writer.add(sample_frame(10 + i));
    v1::Event event;
    event.set_sequence(14);
    event.set_monotonic_ns(kBoot + 14 * 16'666'667);
    event.set_wall_ns(kWall);
    event.mutable_contact()->mutable_contact()->set_in_contact(true);
    event.mutable_contact()->mutable_contact()->set_deepest_mm(0.5);
    writer.add(event);
    writer.finish();
  }

 public:
  ~Export() override { fs::remove_all(folder_); }

 protected:
  int run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"export", file_.string(), "-o", out_.string()});
    std::ostringstream out;
    std::ostringstream error;
    const int code = ctl::run(arguments, out, error);
    said_ = out.str() + error.str();
    return code;
  }
  [[nodiscard]] std::string read(const std::string& name) const {
    return base::read_file(out_ / name);
  }

  fs::path folder_ = fakes::own_path();
  fs::path file_ = folder_ / "press.mcap";
  fs::path out_ = folder_ / "out";
  std::string said_;
};

TEST_F(Export, NumpyStack) {
  ASSERT_EQ(run({"--to", "npy", "--frames", "1:3"}), 0) << said_;
  const std::string npy = read("depth.npy");
  EXPECT_EQ(npy.substr(0, 10), std::string("\x93NUMPY\x01\x00\x76\x00", 10));
  EXPECT_THAT(npy.substr(10, 118),
              HasSubstr("{'descr': '<f4', 'fortran_order': False, 'shape': (2, 2, 3), }"));
  ASSERT_EQ(npy.size(), 128U + 2 * 6 * 4);
  // 0, 1.25, −0.007, NaN, ...
  EXPECT_EQ(npy.substr(128, 8), std::string("\0\0\0\0\0\0\xa0\x3f", 8));
  EXPECT_EQ(npy.substr(140, 4), std::string("\0\0\xc0\x7f", 4));
  EXPECT_THAT(said_, HasSubstr("2 frames, 2 depth maps"));
}

TEST_F(Export, Pictures) {
  ASSERT_EQ(run({"--to", "png", "--frames", "4"}), 0) << said_;
  const auto image = image::decode_png_grey16(read("depth-000004.png"), "test");
  EXPECT_EQ(image.width, 3);
  EXPECT_THAT(image.pixels, ElementsAre(0, 1250, 0, 0, 513, 2));
}

TEST_F(Export, Points) {
  ASSERT_EQ(run({"--to", "ply", "--frames", ":1"}), 0) << said_;
  EXPECT_THAT(read("depth-000000.ply"), HasSubstr("element vertex 4"))
      << "one is untrusted, and its only neighbour in the column has no slope";
}

TEST_F(Export, Tables) {
  ASSERT_EQ(run({"--to", "csv", "--frames", "3:"}), 0) << said_;
  EXPECT_EQ(
      read("frames.csv"),
      "frame,sequence,time_ns,monotonic_ns,in_contact,area_mm2,x_mm,y_mm,deepest_mm,"
      "deepest_x_mm,deepest_y_mm,volume_mm3,force_n,force_uncertainty_n,brightness,calibration,"
      "health,map\n"
      "3,13,1700000000216666671,1216666671,0,0,0,0,1.25,0,0,0,,,128,,,\n"
      "4,14,1700000000233333338,1233333338,0,0,0,0,1.25,0,0,0,,,128,,,\n");
  EXPECT_EQ(read("events.csv"),
            "time_ns,sequence,monotonic_ns,event,detail\n"
            "1700000000233333338,14,1233333338,contact_made,deepest_mm=0.5\n");
}

// A recording may hold any name.
TEST_F(Export, TablesQuoteWhatWouldEndAField) {
  mcap::FileSink sink(file_, true);
  RecordingWriter writer(sink, {.program = "test"});
  writer.add(sample_frame(10));
  v1::Event event;
  event.set_wall_ns(kWall);
  event.set_sequence(7);
  event.mutable_calibration()->set_name("a,\"b\"\nc");
  writer.add(event);
  writer.finish();
  ASSERT_EQ(run({"--to", "csv"}), 0) << said_;
  EXPECT_THAT(read("events.csv"), HasSubstr(",7,0,calibration,\"a,\"\"b\"\"\nc\"\n"));
}

// An earlier export may be longer and in another format. Files that no export wrote stay.
TEST_F(Export, ForceReplacesAnEarlierExport) {
  ASSERT_EQ(run({"--to", "png"}), 0) << said_;
  base::write_file_atomically(out_ / "depth-notes.png", "mine");
  ASSERT_EQ(run({"--to", "png", "--force", "--frames", "1:3"}), 0) << said_;
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(out_)) names.insert(entry.path().filename());
  EXPECT_THAT(names, ElementsAre("depth-000001.png", "depth-000002.png", "depth-notes.png",
                                 "events.csv", "frames.csv"));
  ASSERT_EQ(run({"--to", "npy", "--force"}), 0) << said_;
  EXPECT_FALSE(fs::exists(out_ / "depth-000001.png"));
  EXPECT_TRUE(fs::exists(out_ / "depth-notes.png"));
}

TEST_F(Export, AFailedOneLeavesTheEarlierOne) {
  ASSERT_EQ(run({"--to", "csv"}), 0) << said_;
  base::write_file_atomically(out_ / "depth-1.png", "mine");
  const std::string frames = read("frames.csv");
  EXPECT_EQ(run({"--to", "png", "--force", "--frames", "9:"}), 1);
  EXPECT_EQ(read("frames.csv"), frames);
  ASSERT_EQ(run({"--to", "png", "--force", "--frames", "1:2"}), 0) << said_;
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(out_)) names.insert(entry.path().filename());
  EXPECT_THAT(names, ElementsAre("depth-000001.png", "depth-1.png", "events.csv", "frames.csv"));
}

// NumPy would load the beginning of a stack as one without maps.
TEST_F(Export, LeavesNoStackThatIsNotWhole) {
  mcap::FileSink sink(file_, true);
  RecordingWriter writer(sink, {.program = "test"});
  writer.add(sample_frame(10));
  v1::Frame other = sample_frame(11);
  other.mutable_depth()->set_width(2);
  other.mutable_depth()->set_height(3);
  other.mutable_depth()->set_full_width(2);
  other.mutable_depth()->set_full_height(3);
  writer.add(other);
  writer.finish();
  EXPECT_EQ(run({"--to", "npy"}), 1);
  EXPECT_THAT(said_, HasSubstr("export them apart by --frames"));
  EXPECT_TRUE(fs::is_empty(out_));
}

// Before: a hidden folder with all that was written stayed, and the next export was refused.
TEST_F(Export, CtrlCLeavesNothing) {
  {
    mcap::FileSink sink(file_, true);
    RecordingWriter writer(sink, {.program = "test", .pictures_hz = 0});
    for (std::uint64_t i = 0; i < 5000; ++i) writer.add(sample_frame(10 + i));
    writer.finish();
  }
  // The program's own handler takes its place for as long as it writes.
  const auto before = std::signal(SIGINT, [](int) {});
  int code = 0;
  {
    const std::jthread user([program = ::pthread_self()](const std::stop_token& stop) {
      while (!stop.stop_requested()) {
        ::pthread_kill(program, SIGINT);
        std::this_thread::sleep_for(std::chrono::microseconds(200));
      }
    });
    code = run({"--to", "png"});
  }
  (void)std::signal(SIGINT, before);
  EXPECT_EQ(code, 1);
  EXPECT_THAT(said_, HasSubstr("interrupted: nothing was written"));
  EXPECT_TRUE(fs::is_empty(out_));
}

TEST_F(Export, WhatAKilledOneLeftGoes) {
  fs::create_directories(out_ / ".dtactctl-export" / "more");
  base::write_file_atomically(out_ / ".dtactctl-export" / "depth.npy", "half");
  ASSERT_EQ(run({"--to", "csv"}), 0) << said_;
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(out_)) names.insert(entry.path().filename());
  EXPECT_THAT(names, ElementsAre("events.csv", "frames.csv"));
}

TEST_F(Export, LeavesTheFolderToAnotherProgramThatExportsThere) {
  const fs::path unfinished = out_ / ".dtactctl-export";
  fs::create_directories(unfinished);
  base::write_file_atomically(unfinished / "depth.npy", "half");
  const base::UniqueFd other(::open(unfinished.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  ASSERT_EQ(::flock(other.get(), LOCK_EX | LOCK_NB), 0);
  EXPECT_EQ(run({"--to", "csv"}), 1);
  EXPECT_THAT(said_, HasSubstr("another program is exporting to it"));
  EXPECT_EQ(base::read_file(unfinished / "depth.npy"), "half");
}

// Before: the earlier export was gone, and the new one with it.
TEST_F(Export, OneThatCannotTakeTheEarlierOnesPlaceStays) {
  fs::create_directories(out_ / "events.csv" / "mine");
  EXPECT_EQ(run({"--to", "csv", "--force"}), 1);
  EXPECT_THAT(said_, HasSubstr("the export is in " + (out_ / ".dtactctl-export").string()));
  EXPECT_TRUE(fs::exists(out_ / ".dtactctl-export" / "frames.csv"));
}

TEST_F(Export, SaysWhatIsWrong) {
  EXPECT_EQ(run({"--to", "npy", "--frames", "9:"}), 1);
  EXPECT_THAT(said_, HasSubstr("of its 5 frames none is among --frames 9:"));
  EXPECT_TRUE(fs::is_empty(out_));
  EXPECT_EQ(run({"--to", "npy"}), 0);
  EXPECT_EQ(run({"--to", "npy"}), 1);
  EXPECT_THAT(said_, HasSubstr("is not empty"));
  EXPECT_EQ(run({"--to", "npy", "--force"}), 0);
  EXPECT_THAT(said_, HasSubstr("5 frames, 5 depth maps"));
  EXPECT_EQ(run({"--to", "npy", "--force", "--frames", ""}), 2);
  EXPECT_EQ(run({"--to", "exr"}), 2);
  EXPECT_EQ(run({"--to", "npy", "--frames", "3:x"}), 2);
  base::write_file_atomically(file_, "no mcap");
  EXPECT_EQ(run({"--to", "npy", "--force"}), 1);
  EXPECT_THAT(said_, HasSubstr("is no MCAP file"));
}

}  // namespace
}  // namespace dtact::recording
