// Calibrations on a running daemon, and dtactctl as a user meets it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>

#include "hal/base/atomic_file.hpp"
#include "tests/e2e/sensor.hpp"

namespace dtact::e2e {
namespace {

using ::testing::HasSubstr;

bool depth_flows(client::Client& client) {
  return read_until(client, [](const Item& item) {
    const auto* frame = std::get_if<client::Frame>(&item);
    return frame != nullptr && frame->depth.has_value();
  });
}

/// dtactctl against this daemon; its exit status and what it printed.
int ctl(const Sensor& sensor, std::vector<std::string> arguments, std::string* output = nullptr) {
  arguments.insert(arguments.begin(),
                   {DTACTCTL_PROGRAM, "--port", std::to_string(sensor.daemon->port())});
  return run_program(arguments, output);
}

TEST(Calibration, UncalibratedServesLumaAndSaysHowToCalibrate) {
  const Sensor sensor({}, false);
  client::Client client = sensor.connect();
  client::Subscription both;
  both.luma = client::Luma::grey8;
  client.subscribe(both);
  ASSERT_TRUE(read_until(client, [](const Item& item) {
    const auto* frame = std::get_if<client::Frame>(&item);
    return frame != nullptr && frame->luma && !frame->depth && has(frame->health, "uncalibrated");
  }));
  const client::Status status = client.status();
  EXPECT_EQ(status.state, "uncalibrated");
  EXPECT_THAT(status.advice, HasSubstr("dtactctl calibrate"));
}

TEST(Calibration, UploadBringsDepthAndOutlivesARestart) {
  Sensor sensor({}, false);
  {
    std::string output;
    ASSERT_EQ(ctl(sensor, {"calibration", "upload", calibration_folder().string()}, &output), 0)
        << output;
    client::Client client = sensor.connect();
    client.subscribe({});
    EXPECT_TRUE(depth_flows(client));
  }
  sensor.restart();
  client::Client client = sensor.connect();
  client.subscribe({});
  EXPECT_TRUE(depth_flows(client));
  ASSERT_TRUE(client.status().calibration.has_value());
}

TEST(Calibration, BadUploadIsRefusedAndChangesNothing) {
  const Sensor sensor;
  client::Client client = sensor.connect();
  client.subscribe({});
  ASSERT_TRUE(depth_flows(client));
  const client::CalibrationFiles good = client.calibration();
  client::CalibrationFiles bad = good;
  bad.toml = "version = 'seven'\n";
  EXPECT_THROW(client.upload_calibration(bad), client::Refused);
  bad = good;
  bad.png.resize(bad.png.size() / 2);
  EXPECT_THROW(client.upload_calibration(bad), client::Refused);
  bad = good;
  bad.name = "../../etc";
  EXPECT_THROW(client.upload_calibration(bad), client::Refused);
  EXPECT_TRUE(depth_flows(client));
  EXPECT_EQ(client.calibration().toml, good.toml);
}

TEST(Ctl, StatusSnapshotAndLight) {
  const Sensor sensor;
  {
    client::Client client = sensor.connect();
    client.subscribe({});
    ASSERT_TRUE(depth_flows(client));
  }
  std::string output;
  EXPECT_EQ(ctl(sensor, {"status", "--json"}, &output), 0) << output;
  EXPECT_THAT(output, HasSubstr("\"serving\""));
  const std::filesystem::path file = sensor.folder.path() / "depth.npy";
  EXPECT_EQ(ctl(sensor, {"snapshot", "-o", file.string()}, &output), 0) << output;
  EXPECT_EQ(base::read_file(file).substr(0, 6), "\x93NUMPY");
  EXPECT_EQ(ctl(sensor, {"led", "--brightness", "77"}, &output), 0) << output;
  EXPECT_EQ(sensor.connect().status().light.brightness, 77);
  EXPECT_EQ(ctl(sensor, {"watch", "--seconds", "2"}, &output), 0) << output;
}

TEST(Ctl, SaysWhatIsWrong) {
  Sensor sensor({}, false, {"camera.backend=null"});
  std::string output;
  EXPECT_EQ(ctl(sensor, {"led", "--scheme", "disco"}, &output), 1);
  EXPECT_THAT(output, HasSubstr("scheme4"));
  EXPECT_EQ(sensor.daemon->stop(SIGTERM), 0);
  EXPECT_EQ(run_program({DTACTCTL_PROGRAM, "--port", "1", "status"}, &output), 3);
  EXPECT_THAT(output, HasSubstr("dtactd"));
}

}  // namespace
}  // namespace dtact::e2e
