#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "hal/base/atomic_file.hpp"
#include "hal/files/mcap_writer.hpp"
#include "hal/files/png.hpp"
#include "hal/replay/replay_camera.hpp"
#include "tests/fakes/fake_clock.hpp"
#include "tests/fakes/jpeg_maker.hpp"
#include "tests/fakes/own_path.hpp"

namespace dtact::hal::replay {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
constexpr std::int64_t kMs = 1'000'000;
constexpr std::int64_t kStart = 1'000'000;  // of the fake clock

class ReplayTest : public ::testing::Test {
 protected:
  ReplayTest() {
    fs::remove_all(folder);
    fs::create_directories(folder);
    config.backend = "replay";
    config.fps = 100;
    config.replay.folder = folder;
  }

 public:
  ~ReplayTest() override { fs::remove_all(folder); }

 protected:
  void png(const std::string& name, std::uint8_t grey, int width = 100, int height = 50) {
    const image::Grey8 image{
        width, height, std::vector<std::uint8_t>(static_cast<std::size_t>(width * height), grey)};
    base::write_file_atomically(folder / name, image::encode_png(image));
  }
  std::string jpeg_bytes(std::uint8_t grey, int width = 100) {
    const auto bytes =
        fakes::make_jpeg({.width = width, .height = 50, .quality = 100, .colour = false},
                         [&](int, int) { return int{grey}; });
    return {bytes.begin(), bytes.end()};
  }
  void write(const std::string& name, std::string_view content) {
    base::write_file_atomically(folder / name, content);
  }
  ReplayCamera& open() { return opened.emplace(config, clock); }
  std::string failure() {
    try {
      (void)open();
    } catch (const std::exception& e) {
      return e.what();
    }
    return "";
  }

  fs::path folder = fakes::own_path();
  CameraConfig config;
  fakes::FakeClock clock;
  std::optional<ReplayCamera> opened;
  Frame frame;  // is destroyed before the camera
};

TEST_F(ReplayTest, PlaysInTheOrderOfNamesAndLoops) {
  png("b.png", 20);
  png("a.PNG", 10);
  png("c.png", 30);
  write("notes.txt", "not a frame");
  ReplayCamera& camera = open();
  EXPECT_EQ(camera.info().width, 100);
  EXPECT_EQ(camera.info().height, 50);
  EXPECT_EQ(camera.info().pixel_format, "GREY");
  EXPECT_EQ(camera.info().fps, 100);
  camera.start();
  const std::vector<int> expected = {10, 20, 30, 10, 20, 30, 10};
  for (std::size_t i = 0; i < expected.size(); ++i) {
    ASSERT_EQ(camera.grab(frame, milliseconds(50)), GrabStatus::ok);
    EXPECT_EQ(frame.luma().row(49)[99], expected[i]);
    EXPECT_EQ(frame.info().sequence, i);
    EXPECT_EQ(frame.info().timestamp_ns, kStart + static_cast<std::int64_t>(i) * 10 * kMs);
    EXPECT_EQ(frame.info().flags, kFrameNormal);
  }
  EXPECT_EQ(camera.report().delivered, 7U);
}

TEST_F(ReplayTest, PlaysNumberedFramesInTheOrderOfTheirNumbers) {
  for (const int number : {1, 2, 9, 10, 11, 100}) {
    png(std::to_string(number) + ".png", static_cast<std::uint8_t>(number));
  }
  write("._1.png", "what macOS puts beside it");
  write(".thumbnail.jpg", "");
  ReplayCamera& camera = open();
  camera.start();
  for (const int expected : {1, 2, 9, 10, 11, 100, 1}) {
    ASSERT_EQ(camera.grab(frame, milliseconds(50)), GrabStatus::ok);
    EXPECT_EQ(frame.luma().row(0)[0], expected);
  }
}

TEST_F(ReplayTest, EndsWhenPlayedOnce) {
  png("a.png", 10);
  png("b.png", 20);
  config.replay.loop = false;
  ReplayCamera& camera = open();
  camera.start();
  ASSERT_EQ(camera.grab(frame, milliseconds(50)), GrabStatus::ok);
  ASSERT_EQ(camera.grab(frame, milliseconds(50)), GrabStatus::ok);
  EXPECT_EQ(camera.grab(frame, milliseconds(50)), GrabStatus::ended);
  EXPECT_EQ(camera.report().state, CameraState::ended);
  EXPECT_NE(camera.report().fix, "");
}

TEST_F(ReplayTest, FollowsItsTimestamps) {
  png("a.png", 10);
  png("b.png", 20);
  png("c.png", 30);
  write("timestamps.csv",
        "name,timestamp_ns\na.png,5000000000\nb.png,5010000000\r\nc.png,5040000000\n");
  ReplayCamera& camera = open();
  EXPECT_DOUBLE_EQ(camera.info().fps, 50);  // two intervals in 40 ms
  camera.start();
  // A round takes the mean interval longer than the last frame's time: 60 ms.
  for (const std::int64_t ms : {0, 10, 40, 60, 70, 100, 120}) {
    ASSERT_EQ(camera.grab(frame, milliseconds(50)), GrabStatus::ok);
    EXPECT_EQ(frame.info().timestamp_ns, kStart + ms * kMs);
  }
}

TEST_F(ReplayTest, TimestampsMayBeginWithAByteOrderMark) {
  png("a.png", 10);
  png("b.png", 20);
  write("timestamps.csv",
        "\xEF\xBB\xBF"
        "a.png,5000000000\nb.png,5040000000\n");
  EXPECT_DOUBLE_EQ(open().info().fps, 25);
}

TEST_F(ReplayTest, TimesOutWhenTheNextIsFar) {
  png("a.png", 10);
  config.fps = 10;
  ReplayCamera& camera = open();
  camera.start();
  ASSERT_EQ(camera.grab(frame, milliseconds(1)), GrabStatus::ok);
  EXPECT_EQ(camera.grab(frame, milliseconds(50)), GrabStatus::timeout);
  EXPECT_EQ(clock.now, kStart + 50 * kMs);
  EXPECT_EQ(camera.grab(frame, milliseconds(50)), GrabStatus::ok);
}

TEST_F(ReplayTest, ALateCallerGetsTheNewest) {
  png("a.png", 10);
  png("b.png", 20);
  png("c.png", 30);
  ReplayCamera& camera = open();
  camera.start();
  ASSERT_EQ(camera.grab(frame, milliseconds(50)), GrabStatus::ok);
  clock.now = kStart + 45 * kMs;  // frames 0 to 4 are due: 4 is b
  ASSERT_EQ(camera.grab(frame, milliseconds(50)), GrabStatus::ok);
  EXPECT_EQ(frame.info().sequence, 4U);
  EXPECT_EQ(frame.luma().row(0)[0], 20);
  EXPECT_EQ(frame.info().flags, kFrameNormal) << "skipped here, not lost by a camera";
  EXPECT_EQ(frame.info().ready_ns, kStart + 40 * kMs);  // the caller was 5 ms late
  EXPECT_EQ(camera.report().skipped, 3U);
}

TEST_F(ReplayTest, UnpacedSkipsNothing) {
  png("a.png", 10);
  png("b.png", 20);
  config.replay.paced = false;
  ReplayCamera& camera = open();
  camera.start();
  clock.now = kStart + 1000 * kMs;
  for (std::uint64_t i = 0; i < 5; ++i) {
    ASSERT_EQ(camera.grab(frame, milliseconds(0)), GrabStatus::ok);
    EXPECT_EQ(frame.info().sequence, i);
    EXPECT_EQ(frame.info().timestamp_ns, clock.now);
  }
}

TEST_F(ReplayTest, JpegIsDecodedFrameByFrame) {
  write("a.jpg", jpeg_bytes(10));
  write("b.jpeg", jpeg_bytes(20));
  ReplayCamera& camera = open();
  EXPECT_EQ(camera.info().pixel_format, "MJPEG");
  camera.start();
  Frame first;
  ASSERT_EQ(camera.grab(first, milliseconds(50)), GrabStatus::ok);
  ASSERT_EQ(camera.grab(frame, milliseconds(50)), GrabStatus::ok);
  EXPECT_EQ(first.luma().row(49)[99], 10);  // still whole: two buffers
  EXPECT_EQ(frame.luma().row(49)[99], 20);
  EXPECT_TRUE(std::ranges::equal(frame.jpeg(), jpeg_bytes(20), {}, {},
                                 [](char byte) { return static_cast<std::uint8_t>(byte); }));
}

TEST_F(ReplayTest, ADamagedJpegIsADamagedFrame) {
  write("a.jpg", jpeg_bytes(10));
  const std::string whole = jpeg_bytes(20);
  write("b.jpg", whole.substr(0, whole.size() - 10));
  ReplayCamera& camera = open();
  camera.start();
  ASSERT_EQ(camera.grab(frame, milliseconds(50)), GrabStatus::ok);
  EXPECT_EQ(camera.grab(frame, milliseconds(50)), GrabStatus::damaged);
  ASSERT_EQ(camera.grab(frame, milliseconds(50)), GrabStatus::ok);
  EXPECT_EQ(camera.report().damaged, 1U);
  EXPECT_EQ(camera.report().damage_reason,
            (folder / "b.jpg").string() + ": the payload ends before the end-of-image marker");
  EXPECT_EQ(frame.luma().row(0)[0], 10);
  EXPECT_NO_THROW(check(config));
}

TEST_F(ReplayTest, RefusesProgressiveJpegAndSaysWhatToDo) {
  const auto bytes = fakes::make_jpeg({.width = 100, .height = 50, .progressive = true},
                                      [](int x, int y) { return x + y; });
  write("a.jpg", jpeg_bytes(10));
  write("b.jpg", {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  EXPECT_EQ(failure(), (folder / "b.jpg").string() +
                           ": the payload is not a baseline JPEG of one interleaved scan: save the "
                           "frames as baseline JPEG, or as PNG");
}

TEST_F(ReplayTest, ACheckDecodesTheFirstFrame) {
  const std::string whole = jpeg_bytes(20);
  write("1.jpg", whole.substr(0, whole.size() - 10));
  write("10.jpg", whole);
  config.replay.paced = true;
  try {
    check(config);
    FAIL();
  } catch (const std::runtime_error& e) {
    EXPECT_EQ(e.what(),
              (folder / "1.jpg").string() +
                  ": the payload ends before the end-of-image marker: remove the frame or "
                  "record it again");
  }
  fs::remove(folder / "1.jpg");
  EXPECT_NO_THROW(check(config));
}

TEST_F(ReplayTest, RefusesFoldersWithoutFrames) {
  EXPECT_NE(failure().find("holds no *.png"), std::string::npos) << failure();
  config.replay.folder = folder / "absent";
  EXPECT_NE(failure().find("camera.replay.folder"), std::string::npos) << failure();
}

TEST_F(ReplayTest, RefusesMixedSizesAndKinds) {
  png("a.png", 10);
  png("b.png", 10, 60, 50);
  EXPECT_NE(failure().find("b.png: is 60x50 pixels, the frames before it 100x50"),
            std::string::npos)
      << failure();
  fs::remove(folder / "b.png");
  write("b.jpg", jpeg_bytes(10));
  EXPECT_NE(failure().find("both PNG (a.png) and JPEG (b.jpg)"), std::string::npos) << failure();
  fs::remove(folder / "a.png");
  write("c.jpg", jpeg_bytes(10, 60));
  EXPECT_NE(failure().find("c.jpg: is 60x50"), std::string::npos) << failure();
}

TEST_F(ReplayTest, NamesUnreadableFiles) {
  write("a.jpg", "no picture");
  EXPECT_NE(failure().find("a.jpg: the payload is not a JPEG"), std::string::npos) << failure();
  fs::remove(folder / "a.jpg");
  write("a.png", "no picture");
  EXPECT_NE(failure().find("a.png"), std::string::npos) << failure();
}

TEST_F(ReplayTest, RefusesAJpegThatIsTooWide) {
  std::string bytes = jpeg_bytes(10);
  // The frame header: its marker, length (2), precision (1), height (2), width (2).
  const std::size_t header = bytes.find("\xff\xc0");
  ASSERT_NE(header, std::string::npos);
  bytes[header + 7] = '\x80';  // 100 pixels become 32,868
  write("a.jpg", bytes);
  EXPECT_NE(failure().find("a.jpg: is 32868x50 pixels, a side has at most 16384"),
            std::string::npos)
      << failure();
}

TEST_F(ReplayTest, RefusesTimestampsThatCannotBe) {
  png("a.png", 10);
  png("b.png", 20);
  write("timestamps.csv", "a.png,5\nb.png,soon\n");
  EXPECT_NE(failure().find("timestamps.csv: line 2: \"b.png,soon\""), std::string::npos)
      << failure();
  write("timestamps.csv", "a.png,5\n");
  EXPECT_NE(failure().find("no line for b.png"), std::string::npos) << failure();
  write("timestamps.csv", "a.png,5\nb.png,5\n");
  EXPECT_NE(failure().find("b.png is not later"), std::string::npos) << failure();
  // A year is 3.2e16 ns.
  for (const char* far : {"a.png,0\nb.png,40000000000000000\n",
                          "a.png,-9000000000000000000\nb.png,9000000000000000000\n"}) {
    write("timestamps.csv", far);
    EXPECT_NE(failure().find("b.png is more than a year after"), std::string::npos) << failure();
  }
  write("timestamps.csv", "a.png,5\na.png,6\n");
  EXPECT_NE(failure().find("line 2: a.png stands there twice"), std::string::npos) << failure();
}

TEST_F(ReplayTest, NeedsARate) {
  png("a.png", 10);
  config.fps = 0;
  EXPECT_NE(failure().find("camera.fps"), std::string::npos) << failure();
}

/// A message of foxglove.CompressedImage: format (3), data (2), and a time stamp (1) in between.
std::string compressed_image(const std::string& format, const std::string& data) {
  std::string bytes = "\x1a";
  bytes += static_cast<char>(format.size());
  bytes += format + std::string("\x0a\x02\x08\x07\x12", 5);
  bytes += static_cast<char>(data.size() % 128 | 128);
  bytes += static_cast<char>(data.size() / 128);
  return bytes + data;
}

class ReplayMcap : public ReplayTest {
 protected:
  ReplayMcap() { config.replay.folder = folder / "press.MCAP"; }
  struct Picture {
    std::uint64_t ms;
    std::string bytes;
  };
  /// Writes a file of camera pictures; with several `topics` all are on the last one.
  void record(const std::vector<Picture>& pictures, std::size_t topics = 1) {
    mcap::FileSink sink(config.replay.folder, true);
    mcap::Writer writer(sink);
    const auto other = writer.add_channel(0, "/other", "json");
    const auto schema = writer.add_schema("foxglove.CompressedImage", "protobuf", "");
    std::uint16_t channel = 0;
    for (std::size_t i = 0; i < topics; ++i) {
      channel = writer.add_channel(schema, "/camera" + std::to_string(i), "protobuf");
    }
    for (const Picture& picture : pictures) {
      const std::uint64_t time = 1'700'000'000'000'000'000 + picture.ms * 1'000'000;
      writer.add(mcap::Message{other, 0, time, time, "{}"});
      if (channel != 0) writer.add(mcap::Message{channel, 0, time, time, picture.bytes});
    }
    writer.finish();
  }
  std::string picture(std::uint8_t grey, int width = 100) {
    return compressed_image("jpeg", jpeg_bytes(grey, width));
  }
};

TEST_F(ReplayMcap, PlaysTheCamerasJpegsAtTheirTimes) {
  record({{0, picture(10)}, {10, picture(20)}, {40, picture(30)}});
  ReplayCamera& camera = open();
  EXPECT_EQ(camera.info().pixel_format, "MJPEG");
  EXPECT_EQ(camera.info().width, 100);
  EXPECT_DOUBLE_EQ(camera.info().fps, 50);
  camera.start();
  const std::vector<std::pair<std::int64_t, int>> expected = {
      {0, 10}, {10, 20}, {40, 30}, {60, 10}, {70, 20}};
  for (const auto& [ms, grey] : expected) {
    ASSERT_EQ(camera.grab(frame, milliseconds(50)), GrabStatus::ok);
    EXPECT_EQ(frame.info().timestamp_ns, kStart + ms * kMs);
    EXPECT_EQ(frame.luma().row(49)[99], grey);
  }
}

TEST_F(ReplayMcap, PlaysWhatAKilledRecorderLeft) {
  record({{0, picture(10)}, {10, picture(20)}});
  const std::string whole = base::read_file(config.replay.folder);
  base::write_file_atomically(config.replay.folder, whole.substr(0, whole.size() - 40));
  EXPECT_DOUBLE_EQ(open().info().fps, 100);
}

TEST_F(ReplayMcap, SaysWhatIsWrong) {
  using testing::HasSubstr;
  EXPECT_THAT(failure(), HasSubstr("press.MCAP"));
  record({});
  EXPECT_THAT(failure(), HasSubstr("holds no frame"));
  record({{0, picture(10)}}, 0);
  EXPECT_THAT(failure(), HasSubstr("holds no channel of foxglove.CompressedImage"));
  record({{0, picture(10)}}, 2);
  EXPECT_THAT(failure(), HasSubstr("holds two cameras, /camera0 and /camera1"));
  record({{0, compressed_image("png", "x")}});
  EXPECT_THAT(failure(), HasSubstr("its format is \"png\": only jpeg is played"));
  record({{0, "\x12\x7f"}});
  EXPECT_THAT(failure(), HasSubstr("is no foxglove.CompressedImage"));
  record({{0, compressed_image("jpeg", "no picture")}});
  EXPECT_THAT(failure(), HasSubstr("no frame can be played: 1 message(s) cannot be read"));
}

// The second frame is judged by the first, like every later one.
TEST_F(ReplayMcap, LeavesOutASecondFrameAtTheFirstsTime) {
  record({{7, picture(10)}, {7, picture(20)}, {17, picture(30)}});
  ReplayCamera& camera = open();
  EXPECT_DOUBLE_EQ(camera.info().fps, 100);
  EXPECT_THAT(camera.report().fix,
              testing::AllOf(testing::HasSubstr("1 message(s) cannot be read"),
                             testing::HasSubstr("another frame has the same time")));
  camera.start();
  for (const auto& [ms, grey] : {std::pair{0, 10}, {10, 30}, {20, 10}}) {
    ASSERT_EQ(camera.grab(frame, milliseconds(50)), GrabStatus::ok);
    EXPECT_EQ(frame.info().timestamp_ns, kStart + ms * kMs);
    EXPECT_EQ(frame.luma().row(49)[99], grey);
  }
}

// A year has 3.15e10 ms, a leap year 3.16e10.
TEST_F(ReplayMcap, LeavesOutASecondFrameMoreThanAYearLater) {
  record({{0, picture(10)}, {31'700'000'000, picture(20)}});
  EXPECT_THAT(open().report().fix,
              testing::AllOf(testing::HasSubstr("1 message(s) cannot be read"),
                             testing::HasSubstr("more than a year after the first frame's")));
  record({{0, picture(10)}, {31'500'000'000, picture(20)}});
  EXPECT_EQ(open().report().fix, "");
}

TEST_F(ReplayMcap, PlaysInTheOrderOfTheTimesAndReportsWhatIsLeftOut) {
  using testing::HasSubstr;
  record({{40, picture(30)},
          {0, picture(10)},
          {10, picture(20)},
          {20, compressed_image("jpeg", "no picture")},
          {25, "\x12\x7f"},
          {30, picture(99, 200)},
          {40, picture(98)}});
  ReplayCamera& camera = open();
  EXPECT_DOUBLE_EQ(camera.info().fps, 50);
  EXPECT_THAT(camera.report().fix, HasSubstr("4 message(s) cannot be read, the first because of "
                                             "/camera0, message 4: is no"));
  EXPECT_THAT(camera.report().fix, Not(HasSubstr("earlier"))) << "frames are played by their time";
  camera.start();
  for (const auto& [ms, grey] : {std::pair{0, 10}, {10, 20}, {40, 30}}) {
    ASSERT_EQ(camera.grab(frame, milliseconds(50)), GrabStatus::ok);
    EXPECT_EQ(frame.info().timestamp_ns, kStart + ms * kMs);
    EXPECT_EQ(frame.luma().row(49)[99], grey);
  }
}

}  // namespace
}  // namespace dtact::hal::replay
