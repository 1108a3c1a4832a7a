// dtactctl fleet against servers with pipelines that the tests play.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "hal/base/atomic_file.hpp"
#include "tests/unit/client/played_daemon.hpp"
#include "tests/unit/ctl/run_ctl.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::ctl {
namespace {

namespace fs = std::filesystem;
using net::test::answer_done;
using net::test::Rig;
using test::ctl;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

std::string at(const std::string& name, std::uint16_t port) {
  return name + "=127.0.0.1:" + std::to_string(port);
}

void serve(Rig& rig, double fps, bool well) {
  pipeline::Status status;
  status.state = pipeline::State::serving;
  status.fps = fps;
  status.health.set(pipeline::Health::not_realtime, !well);
  rig.port.set_status(status);
}

TEST(Fleet, IsATableThatNamesWhoIsNotWell) {
  Rig left;
  Rig right;
  std::uint16_t gone = 0;
  {
    const Rig rig;
    gone = rig.tcp_port();
  }
  serve(left, 59.96, true);
  serve(right, 7, false);
  const std::vector<std::string> both{"fleet", "--daemon", at("left", left.tcp_port()), "--daemon",
                                      at("right_hand", right.tcp_port())};
  auto arguments = both;
  arguments.insert(arguments.end(), {"--daemon", at("gone", gone), "status"});
  auto result = ctl(arguments);
  EXPECT_EQ(result.code, 1);
  EXPECT_THAT(result.out, StartsWith("name        state    fps   version  health\n"
                                     "left        serving  60.0  9.8.7    ok\n"
                                     "right_hand  serving  7.0   9.8.7    not_realtime\n"
                                     "gone        nothing listens on 127.0.0.1"));
  EXPECT_THAT(result.out, HasSubstr("\n\nright_hand: "));
  EXPECT_EQ(result.error, "dtactctl: 2 of 3 not well: right_hand, gone\n");
  arguments.emplace_back("--json");
  result = ctl(arguments);
  EXPECT_THAT(
      result.out,
      AllOf(
          StartsWith(R"({"name":"left","error":"","well":true,"status":{"state":"STATE_SERVING")"),
          HasSubstr("\n{\"name\":\"right_hand\",\"error\":\"\",\"well\":false,\"status\":"),
          HasSubstr("\n{\"name\":\"gone\",\"error\":\"nothing listens")));
  serve(right, 7, true);
  arguments = both;
  arguments.emplace_back("status");
  result = ctl(arguments);
  EXPECT_EQ(result.code, 0) << result.error;
}

TEST(Fleet, AsksAllAtTheSameTime) {
  constexpr int kSilent = 8;
  std::string name = (fs::temp_directory_path() / "dtact-ctl-XXXXXX").string();
  const fs::path folder = ::mkdtemp(name.data());
  std::vector<base::UniqueFd> sockets;
  std::vector<std::string> arguments{"fleet", "status", "--timeout", "60"};
  for (int i = 0; i < kSilent; ++i) {
    const std::string file = "s" + std::to_string(i);
    sockets.push_back(client::test::listen_on(folder / file));
    arguments.insert(arguments.end(), {"--daemon", file + "=unix:" + (folder / file).string()});
  }
  // No connection is closed before the last one is accepted.
  std::jthread silent([&sockets] {
    std::vector<base::UniqueFd> asked;
    for (const auto& socket : sockets) asked.emplace_back(::accept(socket.get(), nullptr, nullptr));
  });
  const auto result = ctl(arguments);
  fs::remove_all(folder);
  EXPECT_EQ(result.code, 1);
  EXPECT_THAT(result.error, StartsWith("dtactctl: 8 of 8 not well: s0, s1"));
  EXPECT_THAT(result.out, Not(HasSubstr("in time")));
}

TEST(Fleet, SendsEachItsOwnCalibration) {
  Rig left({}, answer_done);
  Rig right({}, answer_done);
  std::string name = (fs::temp_directory_path() / "dtact-ctl-XXXXXX").string();
  const fs::path folder = ::mkdtemp(name.data());
  fs::create_directory(folder / "left");
  base::write_file_atomically(folder / "left/calibration.toml", "version = 1\n");
  base::write_file_atomically(folder / "left/reference.png", "png");
  const auto result = ctl({"fleet", "upload", folder.string(), "--daemon",
                           at("left", left.tcp_port()), "--daemon", at("right", right.tcp_port())});
  fs::remove_all(folder);
  EXPECT_EQ(result.code, 1);
  EXPECT_THAT(result.out, AllOf(StartsWith("name   calibration\nleft   4\nright  "),
                                HasSubstr("/right/calibration.toml: No such file or directory")));
  EXPECT_EQ(left.store.read(left.store.current_number().value()).name, "left");
  EXPECT_EQ(right.store.read(right.store.current_number().value()).name, "first");
}

TEST(Fleet, TakesNewReferences) {
  Rig left({}, answer_done);
  Rig right({}, [](net::test::FakePort& port) {
    port.answer([](const pipeline::Command& command) {
      return pipeline::CommandDone{command, pipeline::Outcome::refused_contact, "there is contact"};
    });
  });
  const auto result = ctl({"fleet", "rezero", "--daemon", at("left", left.tcp_port()), "--daemon",
                           at("right", right.tcp_port())});
  EXPECT_EQ(result.code, 1);
  EXPECT_EQ(result.out, "name   reference\nleft   new\nright  there is contact\n");
}

TEST(Fleet, RefusesOptionsOfOneDaemon) {
  EXPECT_EQ(ctl({"--host", "gripper", "fleet", "status"}).code, 2);
  const auto result = ctl({"fleet", "status", "--daemon", "a=b", "--ca-file", "c"});
  EXPECT_EQ(result.code, 2);
  EXPECT_THAT(result.error, HasSubstr("--ca-file"));
  EXPECT_THAT(ctl({"fleet", "status", "--daemon", "a=b", "--daemon", "a=c"}).error,
              HasSubstr("two are named a"));
}

}  // namespace
}  // namespace dtact::ctl
