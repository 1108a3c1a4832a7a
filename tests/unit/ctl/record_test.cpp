#include <gmock/gmock.h>
#include <google/protobuf/util/json_util.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "clients/common/reports.pb.h"
#include "tests/unit/client/played_daemon.hpp"
#include "tests/unit/ctl/run_ctl.hpp"

namespace dtact::ctl {
namespace {

namespace fs = std::filesystem;
using client::test::Peer;
using client::test::PlayedDaemon;
using test::ctl;

// dtact-perceive keeps its clients when its daemon is restarted, whose frames count from 1 again.
// Before: 2⁶⁴ less some were missed.
TEST(Record, CountsWhatIsMissedOverARestartOfTheDaemon) {
  PlayedDaemon perceive({[](Peer& peer) {
    peer.greet({"cloud"});
    v1::Reply status;
    status.mutable_status();
    peer.answer(status);
    peer.refuse(v1::ERROR_UNCALIBRATED, "");
    peer.refuse(v1::ERROR_UNCALIBRATED, "");
    peer.done();
    for (const std::uint64_t sequence : {7000U, 7001U, 7004U, 5U, 6U, 10U}) peer.frame(sequence);
  }});
  std::string name = (fs::temp_directory_path() / "dtact-ctl-XXXXXX").string();
  const fs::path folder = ::mkdtemp(name.data());
  const auto result = ctl({"--port", std::to_string(perceive.options.port), "record", "--json",
                           "-o", (folder / "a.mcap").string()});
  EXPECT_EQ(result.code, 3) << "it is gone after its last frame";
  cli::RecordReport report;
  ASSERT_TRUE(google::protobuf::util::JsonStringToMessage(result.out, &report).ok()) << result.out;
  EXPECT_EQ(report.frames(), 6U);
  EXPECT_EQ(report.missed(), 2U + 3U);
  fs::remove_all(folder);
}

/// What dtactctl record subscribes to at a daemon with these features.
std::string subscription_at(const std::vector<std::string>& features,
                            const std::vector<std::string>& options = {}) {
  std::string subscription;
  PlayedDaemon daemon({[&](Peer& peer) {
    peer.greet(features);
    v1::Reply status;
    status.mutable_status();
    peer.answer(status);
    peer.refuse(v1::ERROR_UNCALIBRATED, "");
    peer.refuse(v1::ERROR_UNCALIBRATED, "");
    subscription = peer.done().subscribe().ShortDebugString();
    peer.frame(7);
  }});
  std::string name = (fs::temp_directory_path() / "dtact-ctl-XXXXXX").string();
  const fs::path folder = ::mkdtemp(name.data());
  std::vector<std::string> arguments{"--port", std::to_string(daemon.options.port), "record", "-o",
                                     (folder / "a.mcap").string()};
  arguments.insert(arguments.end(), options.begin(), options.end());
  (void)ctl(arguments);
  daemon.finish();
  fs::remove_all(folder);
  return subscription;
}

TEST(Record, AsksForAllThatAProgramHasForARecording) {
  EXPECT_EQ(subscription_at({}), "depth: DEPTH_PREDICT_ZSTD summary: true jpeg: true");
  EXPECT_EQ(subscription_at({}, {"--no-jpeg"}), "depth: DEPTH_PREDICT_ZSTD summary: true");
  const std::string points =
      "summary: true decimation: 2 contact_box: true cloud: CLOUD_FLOAT32 pose: true";
  EXPECT_EQ(subscription_at({"cloud"}), points);
  EXPECT_EQ(subscription_at({"cloud", "recognition"}), points + " recognition: true");
}

}  // namespace
}  // namespace dtact::ctl
