#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>
#include <gtest/gtest.h>

#include <map>

#include "clients/recording/channels.hpp"
#include "clients/recording/foxglove.pb.h"
#include "clients/recording/pictures.hpp"
#include "clients/recording/read_recording.hpp"
#include "clients/recording/recording_writer.hpp"
#include "tests/fakes/own_path.hpp"
#include "tests/unit/recording/sample.hpp"

namespace dtact::recording {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;
using testing::ThrowsMessage;

class RecordingFile : public testing::Test {
 public:
  ~RecordingFile() override { fs::remove(path_); }

 protected:
  fs::path path_ = fakes::own_path(".mcap");
  mcap::FileSink sink_{path_, true};

  /// (sequence, log time, publish time) of a topic.
  using Row = std::tuple<std::uint32_t, std::uint64_t, std::uint64_t>;
  [[nodiscard]] std::vector<Row> rows(const char* topic) const {
    std::vector<Row> rows;
    mcap::Reader(path_).read({topic}, [&](const mcap::Channel&, const mcap::Message& m) {
      rows.emplace_back(m.sequence, m.log_time, m.publish_time);
      return true;
    });
    return rows;
  }
  template <typename Type>
  [[nodiscard]] Type first(const char* topic) const {
    Type type;
    mcap::Reader(path_).read({topic}, [&](const mcap::Channel&, const mcap::Message& m) {
      EXPECT_TRUE(type.ParseFromArray(m.data.data(), static_cast<int>(m.data.size())));
      return false;
    });
    return type;
  }
};

TEST_F(RecordingFile, HasPointsAndPosesForViewing) {
  const auto frame_at = [](std::uint64_t number) {
    v1::Frame frame;
    frame.set_sequence(number);
    frame.set_monotonic_ns(static_cast<std::int64_t>(1'000'000'000 + number * 16'000'000));
    frame.set_wall_ns(frame.monotonic_ns());
    frame.set_frame_id("dtact_surface");
    frame.mutable_contact()->set_in_contact(number < 3);
    return frame;
  };
  RecordingWriter writer(sink_, {.program = "test", .pictures_hz = 10});
  for (std::uint64_t number = 0; number < 6; ++number) {
    v1::Frame frame = frame_at(number);
    if (number < 3) {
      auto& cloud = *frame.mutable_cloud();
      cloud.set_encoding(v1::CLOUD_FLOAT32);
      cloud.set_width(1);
      cloud.set_height(1);
      cloud.set_points(1);
      cloud.set_data(std::string(24, '\0'));
      frame.mutable_pose()->set_valid(number > 0);
      frame.mutable_pose()->mutable_translation_mm()->set_y(2);
    }
    writer.add(frame);
  }
  writer.finish();
  std::vector<std::size_t> points;
  mcap::Reader(path_).read({kPointsTopic}, [&](const mcap::Channel&, const mcap::Message& m) {
    foxglove::PointCloud cloud;
    EXPECT_TRUE(cloud.ParseFromArray(m.data.data(), static_cast<int>(m.data.size())));
    points.push_back(cloud.data().size());
    return true;
  });
  EXPECT_THAT(points, ElementsAre(24, 0)) << "one of the contact, and none once it has ended";
  EXPECT_THAT(rows(kPoseTopic), SizeIs(2));
  EXPECT_THAT(rows(kTransformsTopic), SizeIs(2));
  EXPECT_DOUBLE_EQ(first<foxglove::PoseInFrame>(kPoseTopic).pose().position().y(), 0.002);
  EXPECT_THAT(rows(kFrameTopic), SizeIs(6));
}

TEST_F(RecordingFile, KeepsAFrameWholeAndItsJpegOnce) {
  RecordingWriter writer(sink_, {.program = "test"});
  writer.add(sample_frame(0));
  writer.add(sample_frame(1));
  writer.finish();
  std::vector<std::string> frames;
  RecordingHandlers handlers;
  handlers.frame = [&](const v1::Frame& frame, std::uint64_t time) {
    EXPECT_EQ(time, static_cast<std::uint64_t>(frame.wall_ns()));
    v1::Frame expected = sample_frame(frame.sequence());
    // The JPEG itself has its size.
    expected.mutable_jpeg()->clear_width();
    expected.mutable_jpeg()->clear_height();
    EXPECT_EQ(frame.SerializeAsString(), expected.SerializeAsString());
    frames.push_back(frame.jpeg().data());
    return true;
  };
  read_recording(mcap::Reader(path_), handlers);
  EXPECT_THAT(frames, ElementsAre("jpeg 0", "jpeg 1"));
  EXPECT_FALSE(first<v1::Frame>(kFrameTopic).has_jpeg());
  const auto image = first<foxglove::CompressedImage>(kCameraTopic);
  EXPECT_EQ(image.format(), "jpeg");
  EXPECT_EQ(image.data(), "jpeg 0");
  EXPECT_EQ(image.timestamp().seconds(), 1'700'000'000);
}

TEST_F(RecordingFile, DrawsDepthForEyesInMicrometres) {
  RecordingWriter writer(sink_, {.program = "test", .pictures_hz = 20});
  for (std::uint64_t i = 0; i < 9; ++i) writer.add(sample_frame(i));
  writer.finish();
  const auto image = first<foxglove::RawImage>(kDepthTopic);
  EXPECT_EQ(image.encoding(), "16UC1");
  EXPECT_EQ(image.width(), 3U);
  EXPECT_EQ(image.height(), 2U);
  EXPECT_EQ(image.step(), 6U);
  EXPECT_EQ(image.frame_id(), "dtact_surface");
  // 0, 1250, −7, untrusted, 513, 2.
  EXPECT_EQ(image.data(), std::string("\0\0\xe2\x04\0\0\0\0\x01\x02\x02\0", 12));
  // 20 of 60 a second.
  std::vector<std::uint32_t> sequences;
  for (const auto& row : rows(kDepthTopic)) sequences.push_back(std::get<0>(row));
  EXPECT_THAT(sequences, ElementsAre(0, 3, 6));
}

TEST_F(RecordingFile, TimesRunOnWhenTheWallClockIsSet) {
  RecordingWriter writer(sink_, {.program = "test"});
  writer.add(sample_frame(0));
  v1::Frame set_back = sample_frame(1);
  set_back.set_wall_ns(kWall - 3'600'000'000'000);
  writer.add(set_back);
  v1::Event event;
  event.set_sequence(1);
  event.set_monotonic_ns(kBoot + 20'000'000);
  event.set_wall_ns(kWall - 3'599'000'000'000);
  event.mutable_state()->set_state(v1::STATE_SERVING);
  writer.add(event);
  writer.finish();
  constexpr std::uint64_t kBegin = kWall;
  EXPECT_THAT(
      rows(kFrameTopic),
      ElementsAre(Row(0, kBegin, kBegin), Row(1, kBegin + 16'666'667, kBegin - 3'600'000'000'000)));
  EXPECT_THAT(rows(kEventTopic),
              ElementsAre(Row(1, kBegin + 20'000'000, kBegin - 3'599'000'000'000)));
}

// Behind dtact-perceive a recording goes on when the daemon's machine restarts. Before: it went on
// at the times of the earlier boot.
TEST_F(RecordingFile, TimesRunOnWhenTheDaemonsMachineRestarts) {
  RecordingWriter writer(sink_, {.program = "test"});
  v1::Frame first = sample_frame(0);
  first.set_monotonic_ns(100'000'000'000);
  writer.add(first);
  v1::Frame later = sample_frame(0);
  later.set_monotonic_ns(3'000'000'000);
  later.set_wall_ns(kWall + 60'000'000'000);
  writer.add(later);
  writer.finish();
  constexpr std::uint64_t kBegin = kWall;
  constexpr std::uint64_t kAgain = kWall + 60'000'000'000;
  EXPECT_THAT(rows(kFrameTopic), ElementsAre(Row(0, kBegin, kBegin), Row(0, kAgain, kAgain)));
}

// A restart shows against the newest frame. Against the first one, 4 s after its boot, the last one
// is only a second older.
TEST_F(RecordingFile, TimesRunOnWhenTheMachineRestartsLateInARecording) {
  RecordingWriter writer(sink_, {.program = "test"});
  const auto add = [&](std::int64_t monotonic_s, std::int64_t wall_s) {
    v1::Frame frame = sample_frame(0);
    frame.set_monotonic_ns(monotonic_s * 1'000'000'000);
    frame.set_wall_ns(kWall + wall_s * 1'000'000'000);
    writer.add(frame);
  };
  add(4, 0);
  add(400, 396);
  add(3, 500);
  writer.finish();
  constexpr std::uint64_t kBegin = kWall;
  constexpr std::uint64_t kLast = kBegin + 396'000'000'000;
  constexpr std::uint64_t kAgain = kBegin + 500'000'000'000;
  EXPECT_THAT(rows(kFrameTopic),
              ElementsAre(Row(0, kBegin, kBegin), Row(0, kLast, kLast), Row(0, kAgain, kAgain)));
}

// Events and frames come in any order. What is a little older is of the same boot, whatever the
// wall clock was set to meanwhile.
TEST_F(RecordingFile, AnOlderEventIsNoRestart) {
  RecordingWriter writer(sink_, {.program = "test"});
  v1::Frame frame = sample_frame(0);
  frame.set_monotonic_ns(400'000'000'000);
  writer.add(frame);
  v1::Event event;
  event.set_sequence(1);
  event.set_monotonic_ns(391'000'000'000);
  event.set_wall_ns(kWall + 3'600'000'000'000);
  event.mutable_state()->set_state(v1::STATE_SERVING);
  writer.add(event);
  writer.finish();
  constexpr std::uint64_t kBegin = kWall;
  EXPECT_THAT(rows(kEventTopic),
              ElementsAre(Row(1, kBegin - 9'000'000'000, kBegin + 3'600'000'000'000)));
}

TEST_F(RecordingFile, ReportsEachLightOnce) {
  RecordingWriter writer(sink_, {.program = "test"});
  for (std::uint64_t i = 0; i < 4; ++i) {
    v1::Frame frame = sample_frame(i);
    frame.mutable_light()->set_brightness(i < 2 ? 128 : 64);
    writer.add(frame);
  }
  writer.finish();
  EXPECT_THAT(rows(kLightTopic), SizeIs(2));
}

// The file alone is enough to build a reader of its messages.
TEST_F(RecordingFile, CarriesItsSchemas) {
  RecordingWriter writer(sink_, {.program = "test"});
  writer.add(sample_frame(0));
  writer.finish();
  const mcap::Reader reader(path_);
  std::map<std::string, std::string> types;
  for (const auto& [id, channel] : reader.channels()) {
    const mcap::Schema& schema = reader.schemas().at(channel.schema);
    types[channel.topic] = schema.name;
    EXPECT_EQ(schema.encoding, "protobuf");
    EXPECT_EQ(channel.message_encoding, "protobuf");
    google::protobuf::FileDescriptorSet files;
    ASSERT_TRUE(files.ParseFromString(schema.data));
    google::protobuf::DescriptorPool pool;
    for (const auto& file : files.file()) ASSERT_NE(pool.BuildFile(file), nullptr) << file.name();
    EXPECT_NE(pool.FindMessageTypeByName(schema.name), nullptr) << schema.name;
  }
  EXPECT_EQ(types, (std::map<std::string, std::string>{{"/camera/jpeg", "foxglove.CompressedImage"},
                                                       {"/dtact/depth", "foxglove.RawImage"},
                                                       {"/dtact/event", "dtact.v1.Event"},
                                                       {"/dtact/frame", "dtact.v1.Frame"},
                                                       {"/dtact/light", "dtact.v1.LightState"},
                                                       {"/dtact/status", "dtact.v1.Status"}}));
}

TEST_F(RecordingFile, FindsTheAttachmentOfATime) {
  RecordingWriter writer(sink_, {.program = "test"});
  writer.add(sample_frame(0));
  writer.attach("a", "text/plain", "one");
  writer.add(sample_frame(60));
  writer.attach("a", "text/plain", "two");
  writer.finish();
  const mcap::Reader reader(path_);
  const auto at = [&](std::int64_t time) {
    return reader.attachment(find_attachment(reader, "a", static_cast<std::uint64_t>(time)).value())
        .data;
  };
  EXPECT_EQ(at(0), "one");
  EXPECT_EQ(at(kWall + 999'000'000), "one");
  EXPECT_EQ(at(kWall + 1'001'000'000), "two");
  // Frame 60 came at that time.
  EXPECT_EQ(at(kWall + 1'000'000'019), "one");
  EXPECT_EQ(at(kWall + 1'000'000'020), "two");
  EXPECT_EQ(reader.attachment(find_attachment(reader, "a").value()).data, "two");
  EXPECT_FALSE(find_attachment(reader, "b"));
}

/// The pixels of a depth picture of one row.
std::vector<unsigned> pixels_of(const std::vector<std::int16_t>& values, double um_per_unit,
                                std::int16_t untrusted) {
  v1::Frame frame;
  auto& map = *frame.mutable_depth();
  map.set_encoding(v1::DEPTH_INT16);
  map.set_width(static_cast<std::uint32_t>(values.size()));
  map.set_height(1);
  map.set_um_per_unit(um_per_unit);
  map.set_untrusted_value(untrusted);
  wire::encode_int16(values, *map.mutable_data());
  const std::string data = depth_picture(frame, 0).data();
  std::vector<unsigned> pixels;
  for (std::size_t i = 0; i + 1 < data.size(); i += 2) {
    pixels.push_back(static_cast<unsigned char>(data[i]) +
                     256U * static_cast<unsigned char>(data[i + 1]));
  }
  return pixels;
}

TEST(DepthPicture, RoundsToMicrometresAndEndsAtTheLimitsOfItsPixels) {
  // 0.4, 0.6, 1, 1.4, 1.6 µm.
  EXPECT_THAT(pixels_of({2, 3, 5, 7, 8}, 0.2, -1), ElementsAre(0, 1, 1, 1, 2));
  EXPECT_THAT(pixels_of({-1, 0, 1, 2}, 1, -2), ElementsAre(0, 0, 1, 2));
  // 65534, 65536 and 65538 µm, of which 16 bits hold the first.
  EXPECT_THAT(pixels_of({32767, 21845, 21846}, 3, -1), ElementsAre(65535, 65535, 65535));
  EXPECT_THAT(pixels_of({32767}, 2, -1), ElementsAre(65534));
  EXPECT_THAT(pixels_of({7, 300, 301}, 1, 300), ElementsAre(7, 0, 301)) << "untrusted and pressed";
}

TEST(LumaPicture, IsThatOfTheFrame) {
  v1::Frame frame;
  frame.set_frame_id("dtact_surface");
  frame.mutable_luma()->set_width(3);
  frame.mutable_luma()->set_height(2);
  frame.mutable_luma()->set_data("abcdef");
  const foxglove::RawImage image = luma_picture(frame, 5'000'000'007);
  EXPECT_EQ(image.timestamp().seconds(), 5);
  EXPECT_EQ(image.timestamp().nanos(), 7);
  EXPECT_EQ(image.frame_id(), "dtact_camera");
  EXPECT_EQ(image.width(), 3U);
  EXPECT_EQ(image.height(), 2U);
  EXPECT_EQ(image.encoding(), "mono8");
  EXPECT_EQ(image.step(), 3U);
  EXPECT_EQ(image.data(), "abcdef");
}

// Each coordinate of its own, so that none stands for another.
TEST(PosePicture, IsInMetresAndAUnitQuaternion) {
  v1::Frame frame;
  frame.set_frame_id("dtact_surface");
  auto& pose = *frame.mutable_pose();
  pose.mutable_translation_mm()->set_x(1.5);
  pose.mutable_translation_mm()->set_y(-2.25);
  pose.mutable_translation_mm()->set_z(0.75);
  // 120° about (1, −2, 2) / 3.
  pose.mutable_rotation_deg()->set_x(40);
  pose.mutable_rotation_deg()->set_y(-80);
  pose.mutable_rotation_deg()->set_z(80);
  const auto is_there = [](const auto& position, const auto& turn) {
    EXPECT_NEAR(position.x(), 0.0015, 1e-12);
    EXPECT_NEAR(position.y(), -0.00225, 1e-12);
    EXPECT_NEAR(position.z(), 0.00075, 1e-12);
    EXPECT_NEAR(turn.x(), 0.28867513, 1e-8);
    EXPECT_NEAR(turn.y(), -0.57735027, 1e-8);
    EXPECT_NEAR(turn.z(), 0.57735027, 1e-8);
    EXPECT_NEAR(turn.w(), 0.5, 1e-8);
  };
  const foxglove::PoseInFrame in_frame = pose_in_frame(frame, 5'000'000'007);
  EXPECT_EQ(in_frame.timestamp().seconds(), 5);
  EXPECT_EQ(in_frame.timestamp().nanos(), 7);
  is_there(in_frame.pose().position(), in_frame.pose().orientation());
  const foxglove::FrameTransforms all = transforms(frame, 5'000'000'007);
  ASSERT_EQ(all.transforms_size(), 1);
  EXPECT_EQ(all.transforms(0).timestamp().seconds(), 5);
  EXPECT_EQ(all.transforms(0).timestamp().nanos(), 7);
  is_there(all.transforms(0).translation(), all.transforms(0).rotation());
}

// Other writers may put several pictures before their frames.
TEST_F(RecordingFile, AFrameHasItsOwnJpegOfEightThatStandBeforeIt) {
  mcap::Writer writer(sink_);
  const auto jpegs = writer.add_channel(
      writer.add_schema("foxglove.CompressedImage", "protobuf", ""), kCameraTopic, "protobuf");
  const auto frames = writer.add_channel(writer.add_schema("dtact.v1.Frame", "protobuf", ""),
                                         kFrameTopic, "protobuf");
  for (std::uint64_t i = 0; i < 9; ++i) {
    foxglove::CompressedImage image;
    image.set_data("jpeg " + std::to_string(i));
    writer.add(mcap::Message{jpegs, 0, 10 + i, 10 + i, image.SerializeAsString()});
  }
  v1::Frame frame = sample_frame(0);
  frame.clear_jpeg();
  const std::string bytes = frame.SerializeAsString();
  for (const std::uint64_t i : {0U, 1U, 8U, 8U, 5U}) {
    writer.add(mcap::Message{frames, 0, 10 + i, 10 + i, bytes});
  }
  writer.finish();
  std::vector<std::string> came;
  RecordingHandlers handlers;
  handlers.frame = [&](const v1::Frame& one, std::uint64_t) {
    came.push_back(one.jpeg().data());
    return true;
  };
  read_recording(mcap::Reader(path_), handlers);
  // The first of nine is given up, and each one is used once.
  EXPECT_THAT(came, ElementsAre("", "jpeg 1", "jpeg 8", "", "jpeg 5"));
}

TEST_F(RecordingFile, AnUndecodableFrameAmongGoodOnesIsCounted) {
  mcap::Writer writer(sink_);
  const auto channel = writer.add_channel(writer.add_schema("dtact.v1.Frame", "protobuf", ""),
                                          kFrameTopic, "protobuf");
  const std::string good = sample_frame(5).SerializeAsString();
  writer.add(mcap::Message{channel, 0, 10, 10, good});
  writer.add(mcap::Message{channel, 1, 20, 20, "\xff\xff"});
  writer.add(mcap::Message{channel, 2, 30, 30, good});
  writer.finish();
  const mcap::Reader reader(path_);
  std::vector<std::uint64_t> times;
  RecordingHandlers handlers;
  handlers.frame = [&](const v1::Frame&, std::uint64_t time) {
    times.push_back(time);
    return true;
  };
  read_recording(reader, handlers);
  EXPECT_THAT(times, ElementsAre(10, 30));
  EXPECT_THAT(reader.damage(), HasSubstr("1 message(s) cannot be read, the first because of "
                                         "/dtact/frame: message 1 is no dtact.v1.Frame"));
}

TEST_F(RecordingFile, RefusesAFileOfSomethingElse) {
  mcap::Writer writer(sink_);
  writer.finish();
  EXPECT_THAT([&] { read_recording(mcap::Reader(path_), {}); },
              ThrowsMessage<mcap::Error>(HasSubstr("name a file of dtactctl record")));
}

}  // namespace
}  // namespace dtact::recording
