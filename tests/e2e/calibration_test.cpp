// Calibrations on a running daemon, and dtactctl as a user runs it.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <thread>

#include "hal/base/atomic_file.hpp"
#include "hal/sim/scene.hpp"
#include "tests/e2e/depth_error.hpp"
#include "tests/e2e/sensor.hpp"

namespace dtact::e2e {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

bool depth_flows(client::Client& client) {
  return read_until(client, [](const Item& item) {
    const auto* frame = std::get_if<v1::Frame>(&item);
    return frame != nullptr && frame->has_depth();
  });
}

v1::UploadCalibration upload_of(const v1::CalibrationFiles& files) {
  v1::UploadCalibration upload;
  upload.set_name(files.name());
  upload.set_calibration_toml(files.calibration_toml());
  upload.set_reference_png(files.reference_png());
  return upload;
}

/// Runs dtactctl against this daemon; returns its exit status and output.
int ctl(const Sensor& sensor, std::vector<std::string> arguments, std::string* output = nullptr) {
  arguments.insert(arguments.begin(),
                   {DTACTCTL_PROGRAM, "--port", std::to_string(sensor.daemon->port())});
  return run_program(arguments, output);
}

TEST(Calibration, UncalibratedServesLumaAndSaysHowToCalibrate) {
  const Sensor sensor({}, false);
  client::Client client = sensor.connect();
  v1::Subscribe both = client::depth_stream();
  both.set_luma(v1::LUMA_GREY8);
  client.subscribe(both);
  ASSERT_TRUE(read_until(client, [](const Item& item) {
    const auto* frame = std::get_if<v1::Frame>(&item);
    return frame != nullptr && frame->has_luma() && !frame->has_depth() &&
           has(frame->health(), v1::HEALTH_UNCALIBRATED);
  }));
  const v1::Status status = client.status();
  EXPECT_EQ(status.state(), v1::STATE_UNCALIBRATED);
  EXPECT_THAT(status.advice(), HasSubstr("dtact-calibrate"));
}

// config/simulated, as the package installs it. When this fails after a change of the simulator or
// of calibration: ./dev calibration.
TEST(Calibration, TheSimulatedSensorHasOneOfItsOwn) {
  const std::string shipped = scene_file("../simulated").string();
  Sensor sensor({}, false, {"camera.sim.calibration=" + shipped});
  {
    client::Client client = sensor.connect();
    client.subscribe();
    const hal::sim::Truth truth(hal::sim::default_scene());
    int pressed = 0;
    double force_n = 0;
    ASSERT_TRUE(read_until(client, [&](const Item& item) {
      const auto* frame = std::get_if<v1::Frame>(&item);
      if (frame == nullptr || !frame->has_depth() || frame->sequence() % 720 >= 360) return false;
      const DepthError error = depth_error(*frame, truth);
      if (error.inside_pixels <= 5000) return false;
      EXPECT_LE(error.inside_mm, 0.03);
      for (const v1::Health flag : {v1::HEALTH_CAMERA_MISMATCH, v1::HEALTH_LIGHT_MISMATCH,
                                    v1::HEALTH_CAMERA_SHIFTED, v1::HEALTH_BEYOND_CALIBRATION}) {
        EXPECT_FALSE(has(frame->health(), flag)) << v1::Health_Name(flag);
      }
      force_n = std::max(force_n, frame->contact().force_n());
      return ++pressed == 5;
    }));
    EXPECT_GT(force_n, 0.1);
    EXPECT_EQ(client.status().calibration().name(), "simulated");
  }
  std::string output;
  EXPECT_EQ(ctl(sensor, {"status"}, &output), 0) << output;
  EXPECT_THAT(output, HasSubstr("sim sim:dtact-sim (simulated), 800x600"));
  EXPECT_EQ(ctl(sensor, {"watch", "--seconds", "1.5"}, &output), 0) << output;
  EXPECT_THAT(output, AllOf(StartsWith("simulated  "), HasSubstr(" fps  contact ")));
  // One that is uploaded takes its place, also after a restart, until "configured" is activated.
  EXPECT_EQ(ctl(sensor, {"calibration", "upload", calibration_folder().string()}, &output), 0);
  sensor.restart();
  EXPECT_EQ(sensor.connect().status().calibration().name(), "calibration");
  EXPECT_EQ(ctl(sensor, {"calibration", "activate", "configured"}, &output), 0) << output;
  EXPECT_EQ(sensor.connect().status().calibration().name(), "simulated");
}

TEST(Calibration, NoOtherCameraGetsTheSimulatedSensorsOne) {
  const std::string shipped = scene_file("../simulated").string();
  Sensor sensor({}, false, {"camera.sim.calibration=" + shipped, "camera.backend=null"});
  const v1::Status status = sensor.connect().status();
  EXPECT_FALSE(status.has_calibration());
  EXPECT_EQ(status.state(), v1::STATE_UNCALIBRATED);
  std::string output;
  EXPECT_EQ(ctl(sensor, {"calibration", "activate", "configured"}, &output), 1);
  EXPECT_THAT(output, HasSubstr("the configuration file names no calibration"));
}

TEST(Calibration, UploadBringsDepthAndOutlivesARestart) {
  Sensor sensor({}, false);
  {
    std::string output;
    ASSERT_EQ(ctl(sensor, {"calibration", "upload", calibration_folder().string()}, &output), 0)
        << output;
    client::Client client = sensor.connect();
    client.subscribe();
    EXPECT_TRUE(depth_flows(client));
  }
  sensor.restart();
  client::Client client = sensor.connect();
  client.subscribe();
  EXPECT_TRUE(depth_flows(client));
  ASSERT_TRUE(client.status().has_calibration());
}

TEST(Calibration, BadUploadIsRefusedAndChangesNothing) {
  const Sensor sensor;
  client::Client client = sensor.connect();
  client.subscribe();
  ASSERT_TRUE(depth_flows(client));
  const v1::UploadCalibration good = upload_of(client.calibration());
  v1::UploadCalibration bad = good;
  bad.set_calibration_toml("version = 'seven'\n");
  EXPECT_THROW(client.upload_calibration(bad), client::Refused);
  bad = good;
  bad.mutable_reference_png()->resize(good.reference_png().size() / 2);
  EXPECT_THROW(client.upload_calibration(bad), client::Refused);
  bad = good;
  bad.set_name("../../etc");
  EXPECT_THROW(client.upload_calibration(bad), client::Refused);
  EXPECT_TRUE(depth_flows(client));
  EXPECT_EQ(client.calibration().calibration_toml(), good.calibration_toml());
}

/// Whether the next frames with depth have pixels of this size, which differs between calibrations.
bool depth_flows_at(client::Client& client, double mm_per_px) {
  return read_until(client, [mm_per_px](const Item& item) {
    const auto* frame = std::get_if<v1::Frame>(&item);
    return frame != nullptr && frame->has_depth() && frame->depth().mm_per_px() == mm_per_px;
  });
}

bool is_reported(client::Client& client, const std::string& name) {
  return read_until(client, [&name](const Item& item) {
    const auto* event = std::get_if<v1::Event>(&item);
    return event != nullptr && event->calibration().name() == name;
  });
}

/// A sensor with a configured calibration and an uploaded one, "other", number 1, in use. They
/// differ in the size of their pixels only.
class TwoCalibrations : public testing::Test {
 protected:
  static constexpr double kConfigured = 0.0413793;  // tests/e2e/sensor.cpp
  static constexpr double kOther = 0.05;

  TwoCalibrations() {
    client::Client client = sensor_.connect();
    v1::UploadCalibration files = upload_of(client.calibration());
    std::string& toml = *files.mutable_calibration_toml();
    const std::string key = "mm_per_px = 0.0413793";
    const std::size_t at = toml.find(key);
    if (at == std::string::npos) throw std::runtime_error("no " + key);
    toml.replace(at, key.size(), "mm_per_px = 0.05");
    files.set_name("other");
    client.upload_calibration(files);
  }

  /// The list that dtactctl prints.
  [[nodiscard]] std::string list() const {
    std::string output;
    EXPECT_EQ(ctl(sensor_, {"calibration", "list"}, &output), 0) << output;
    return output;
  }
  [[nodiscard]] int activate(const std::string& id, std::string* output = nullptr) const {
    return ctl(sensor_, {"calibration", "activate", id}, output);
  }
  [[nodiscard]] bool depth_flows_again_at(double mm_per_px) const {
    client::Client client = sensor_.connect();
    client.subscribe();
    return depth_flows_at(client, mm_per_px);
  }

  // A scene and a rate at which sanitizers lose no frame: the last status is to advise nothing.
  Sensor sensor_{scene_file("nothing.toml"), true, {"camera.fps=20"}};
};

TEST_F(TwoCalibrations, SwitchAtOnceAndStaySoAfterARestart) {
  EXPECT_THAT(list(), AllOf(HasSubstr("  configured"), HasSubstr("*          1  20")));
  client::Client watcher = sensor_.connect();
  watcher.subscribe();
  ASSERT_TRUE(depth_flows_at(watcher, kOther));
  std::string output;
  ASSERT_EQ(activate("configured", &output), 0) << output;
  EXPECT_TRUE(is_reported(watcher, "calibration"));
  EXPECT_TRUE(depth_flows_at(watcher, kConfigured));
  sensor_.restart();
  EXPECT_TRUE(depth_flows_again_at(kConfigured));
  EXPECT_THAT(list(), HasSubstr("* configured"));
  ASSERT_EQ(activate("1", &output), 0) << output;
  sensor_.restart();
  EXPECT_TRUE(depth_flows_again_at(kOther));
}

TEST_F(TwoCalibrations, ADamagedOneIsRefusedAndChangesNothing) {
  std::string output;
  ASSERT_EQ(activate("configured", &output), 0) << output;
  base::write_file_atomically(sensor_.folder.path() / "state/calibrations/1/other/reference.png",
                              "no PNG");
  EXPECT_EQ(activate("1", &output), 1);
  EXPECT_THAT(output, HasSubstr("reference"));
  EXPECT_EQ(activate("2", &output), 1);
  EXPECT_THAT(output, HasSubstr("there is no calibration 2"));
  EXPECT_TRUE(depth_flows_again_at(kConfigured));
  EXPECT_THAT(list(), AllOf(HasSubstr("* configured"), HasSubstr("cannot be read: ")));
}

TEST_F(TwoCalibrations, ADaemonWhoseUploadedOneIsDamagedStartsAndCanBeFixed) {
  const auto file = sensor_.folder.path() / "state/calibrations/1/other/calibration.toml";
  base::write_file_atomically(file, "version = 1\n");
  sensor_.restart();
  EXPECT_EQ(sensor_.connect().status().state(), v1::STATE_UNCALIBRATED);
  EXPECT_THAT(sensor_.daemon->log(), HasSubstr("dtactctl calibration activate"));
  EXPECT_THAT(list(), AllOf(HasSubstr(">          1  20"), HasSubstr("none is in use")));
  std::string output;
  ASSERT_EQ(activate("configured", &output), 0) << output;
  EXPECT_TRUE(depth_flows_again_at(kConfigured));
}

// SIGKILL in the middle of a start stands for a calibration that ends the daemon, or is so large
// that systemd does. A start that has got past it does not count, and the counting begins again.
TEST_F(TwoCalibrations, ADaemonThatOneKeepsFromStartingBeginsWithTheConfiguredOne) {
  ASSERT_EQ(sensor_.daemon->stop(SIGTERM), 0);
  std::vector<std::string> command = sensor_.arguments;
  command.insert(command.begin(), DTACTD_PROGRAM);
  const auto starts = sensor_.folder.path() / "state/calibration.starts";
  const auto is_counted = [&starts](int count) {
    std::ifstream file(starts);
    std::string calibration;
    int counted = 0;
    return std::getline(file, calibration) && file >> counted && counted == count;
  };
  int tries = 0;
  for (int ended_early = 0; ended_early < 3; ++tries) {
    ASSERT_LT(tries, 50);
    Program start(command);
    while (!is_counted(ended_early + 1) && start.log().find("listening on") == std::string::npos) {
      ASSERT_FALSE(start.ended()) << start.log();
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    EXPECT_EQ(start.stop(SIGKILL), 128 + SIGKILL);
    ended_early = is_counted(ended_early + 1) ? ended_early + 1 : 0;
  }
  sensor_.daemon = std::make_unique<DaemonProcess>(sensor_.arguments);
  EXPECT_TRUE(depth_flows_again_at(kConfigured));
  const std::string said = "Calibration 1 (other) is not used: 3 starts with it ended early";
  EXPECT_THAT(sensor_.daemon->log(), HasSubstr(said));
  EXPECT_THAT(sensor_.connect().status().advice(), HasSubstr(said));
  EXPECT_THAT(list(), AllOf(HasSubstr("* configured"), HasSubstr(">          1  20")));
  std::string output;
  EXPECT_EQ(
      ctl(sensor_, {"calibration", "download", "1", "-o", sensor_.folder.path() / "copy"}, &output),
      0)
      << output;
  ASSERT_EQ(activate("1", &output), 0) << output;
  EXPECT_TRUE(depth_flows_again_at(kOther));
  // A busy machine leaves frames out for a while, and the status advises on that.
  std::string advice = sensor_.connect().status().advice();
  for (int i = 0; i < 30 && !advice.empty(); ++i) {
    std::this_thread::sleep_for(std::chrono::seconds(1));
    advice = sensor_.connect().status().advice();
  }
  EXPECT_EQ(advice, "");
  sensor_.restart();
  EXPECT_TRUE(depth_flows_again_at(kOther));
}

TEST(Calibration, TheStateFolderHasOneOwner) {
  const Sensor sensor;
  std::vector<std::string> second = sensor.arguments;
  second.insert(second.begin(), DTACTD_PROGRAM);
  std::string output;
  EXPECT_EQ(run_program(second, &output), 1);
  EXPECT_THAT(output, AllOf(HasSubstr("belongs to dtactd, process " +
                                      std::to_string(sensor.daemon->pid()) + ", sensor "),
                            HasSubstr("set state_dir")));
}

// Each upload is kept or refused with a word, and none takes the number of another.
TEST(Calibration, UploadsAtOnceAreNotLost) {
  const Sensor sensor;
  const v1::UploadCalibration files = upload_of(sensor.connect().calibration());
  std::atomic<int> kept{0};
  std::vector<std::thread> clients;
  for (int i = 0; i < 6; ++i) {
    clients.emplace_back([&sensor, &kept, upload = files, i]() mutable {
      client::Client client = sensor.connect();
      upload.set_name(fmt::format("upload-{}", i));
      for (int patience = 0; patience < 300; ++patience) {
        try {
          client.upload_calibration(upload);
          ++kept;
          return;
        } catch (const client::Refused& e) {
          EXPECT_EQ(e.code(), v1::ERROR_BUSY) << e.what();
          std::this_thread::sleep_for(std::chrono::milliseconds(100));
        }
      }
    });
  }
  for (std::thread& client : clients) client.join();
  EXPECT_EQ(kept, 6);
  std::set<std::string> names;
  for (const auto& stored : sensor.connect().calibrations()) {
    if (stored.number() > 0) names.insert(stored.name());
  }
  EXPECT_EQ(names.size(), 6U);
}

TEST_F(TwoCalibrations, AreExportedAsTheyWereUploaded) {
  const auto folder = sensor_.folder.path() / "copy";
  std::string output;
  ASSERT_EQ(ctl(sensor_, {"calibration", "download", "configured", "-o", folder.string()}, &output),
            0)
      << output;
  for (const char* file : {"calibration.toml", "reference.png"}) {
    EXPECT_EQ(base::read_file(folder / file), base::read_file(calibration_folder() / file));
  }
  ASSERT_EQ(ctl(sensor_, {"calibration", "upload", folder.string()}, &output), 0) << output;
  EXPECT_TRUE(depth_flows_again_at(kConfigured));
}

TEST(Ctl, StatusSnapshotAndLight) {
  const Sensor sensor;
  {
    client::Client client = sensor.connect();
    client.subscribe();
    ASSERT_TRUE(depth_flows(client));
  }
  std::string output;
  EXPECT_EQ(ctl(sensor, {"status", "--json"}, &output), 0) << output;
  EXPECT_THAT(output, HasSubstr("\"STATE_SERVING\""));
  const std::filesystem::path file = sensor.folder.path() / "depth.npy";
  EXPECT_EQ(ctl(sensor, {"snapshot", "-o", file.string()}, &output), 0) << output;
  EXPECT_EQ(base::read_file(file).substr(0, 6), "\x93NUMPY");
  EXPECT_EQ(ctl(sensor, {"led", "--brightness", "77"}, &output), 0) << output;
  EXPECT_EQ(sensor.connect().status().light().brightness(), 77U);
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
