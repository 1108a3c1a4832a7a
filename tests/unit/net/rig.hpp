#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "daemon/net/calibration_store.hpp"
#include "daemon/net/server.hpp"
#include "tests/unit/net/fake_port.hpp"

namespace dtact::net::test {

/// A store in memory with a configured calibration, "factory", and three others of which "first" is
/// current. The text "bad" is not a calibration; making the one with "unwritable" current fails.
class FakeStore : public CalibrationStore {
 public:
  /// Before the first request.
  void clear() { files_.clear(); }
  std::shared_ptr<const calibration::Calibration> check(
      const CalibrationFiles& files,
      const std::optional<calibration::FrameSize>& /*camera*/) override {
    if (files.toml == "bad") throw std::runtime_error("upload: calibration.toml:3: scale missing");
    auto calibration = std::make_shared<calibration::Calibration>();
    calibration->name = files.name;
    return calibration;
  }
  KeptCalibration keep(const CalibrationFiles& files) override {
    if (files.toml == "unwritable") throw std::runtime_error("cannot write /state/x: disk full");
    files_.push_back(files);
    files_.back().number = files_.size() - 1;
    current_ = files_.back().number;
    if (current_ < 5) return {current_};
    return {current_, {{.number = 2, .name = "broken", .uploaded = "2026-01-31T12:00:00Z"}}};
  }
  std::vector<StoredCalibration> list() override {
    std::vector<StoredCalibration> all;
    for (const auto& files : files_) {
      auto& stored = all.emplace_back();
      stored.number = files.number;
      stored.name = files.name;
      stored.current = files.number == current_;
      stored.pinned = files.number > 0 && files.number == pinned_;
      if (files.number > 0) stored.uploaded = "2026-01-31T12:00:00Z";
      if (files.toml == "bad") {
        stored.damage = "calibration.toml:3: scale missing";
      } else {
        stored.summary = {files.name, "lut", 0.0414, 580, 580, -0.02, 1.4, "", 800, 600, {}};
      }
    }
    return all;
  }
  std::shared_ptr<const calibration::Calibration> load(
      std::uint64_t number, const std::optional<calibration::FrameSize>& camera) override {
    return check(at(number), camera);
  }
  void make_current(std::uint64_t number) override {
    if (at(number).toml == "unwritable") throw std::runtime_error("cannot write /state: disk full");
    current_ = number;
  }
  void pin(std::uint64_t number, bool pinned) override {
    (void)at(number);
    pinned_ = pinned ? number : 0;
  }
  [[nodiscard]] std::optional<std::uint64_t> current_number() const override { return current_; }
  CalibrationFiles read(std::uint64_t number) override { return at(number); }

 private:
  [[nodiscard]] const CalibrationFiles& at(std::uint64_t number) const {
    if (number < files_.size()) return files_[number];
    throw NoSuchCalibration("there is no calibration " + std::to_string(number));
  }

  std::vector<CalibrationFiles> files_ = {{"factory", "toml of factory", "png of factory", 0},
                                          {"first", "toml of first", "png of first", 1},
                                          {"broken", "bad", "png", 2},
                                          {"stuck", "unwritable", "png", 3}};
  std::uint64_t current_ = 1;
  std::uint64_t pinned_ = 0;
};

/// A server on a free loopback port with a fake pipeline, running on a thread of its own.
class Rig {
 public:
  explicit Rig(NetConfig config = {}, const std::function<void(FakePort&)>& prepare = {}) {
    if (prepare) prepare(port);
    config.port = 0;
    config.program = "dtactd 9.8.7";
    config.version = "9.8.7";
    config.log = [this](const LogLine& line) {
      const std::lock_guard lock(mutex_);
      log_ += line.text + "\n";
    };
    server_ = std::make_unique<Server>(io_, config, port, store);
    thread_ = std::thread([this] { io_.run(); });
  }
  ~Rig() { stop(); }
  Rig(const Rig&) = delete;
  Rig& operator=(const Rig&) = delete;

  /// Returns once the loop has run out of work by itself.
  void stop() {
    if (!thread_.joinable()) return;
    boost::asio::post(io_, [this] { server_->stop(); });
    thread_.join();
  }
  [[nodiscard]] Overview overview() {
    std::promise<Overview> reported;
    boost::asio::post(io_, [&] { reported.set_value(server_->overview()); });
    return reported.get_future().get();
  }
  void reload(const NetConfig& fresh) {
    std::promise<void> done;
    boost::asio::post(io_, [&] {
      server_->reload(fresh);
      done.set_value();
    });
    done.get_future().get();
  }
  [[nodiscard]] std::uint16_t tcp_port() const { return server_->port(); }
  [[nodiscard]] std::string log() {
    const std::lock_guard lock(mutex_);
    return log_;
  }
  /// Waits until the log contains `text`.
  [[nodiscard]] bool wait_log(const std::string& text) {
    const auto end = std::chrono::steady_clock::now() + kTimeout;
    while (log().find(text) == std::string::npos) {
      if (std::chrono::steady_clock::now() > end) return false;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return true;
  }

  FakePort port;
  FakeStore store;

 private:
  std::mutex mutex_;
  std::string log_;
  boost::asio::io_context io_;
  std::unique_ptr<Server> server_;
  std::thread thread_;
};

/// Answers every command with "done", at once; the reference image is one grey pixel.
inline void answer_done(FakePort& port) {
  port.answer([](const pipeline::Command& command) {
    pipeline::CommandDone done{command, pipeline::Outcome::done, ""};
    if (std::holds_alternative<pipeline::CopyReference>(command.what)) {
      done.command.what = pipeline::CopyReference{std::make_shared<pipeline::ReferenceCopy>(
          pipeline::ReferenceCopy{.width = 1, .height = 1, .image_q8 = {25600}, .light = {}})};
    }
    return done;
  });
}

}  // namespace dtact::net::test
