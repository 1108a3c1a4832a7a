#include "daemon/app/reload.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/app/config_keys.hpp"

namespace dtact::app {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

TEST(Reload, TakesWhatCanChangeAndNamesTheRest) {
  Config running;
  Config fresh = running;
  fresh.log_level = "debug";
  fresh.net.max_clients = 3;
  fresh.hal.camera.backend = "v4l2";
  fresh.pipeline.light.brightness = 100;
  const Reload reload = merge(running, fresh);
  EXPECT_THAT(reload.changed, ElementsAre("log_level", "net.max_clients"));
  EXPECT_THAT(reload.restart, ElementsAre("camera.backend", "ring.brightness"));
  EXPECT_EQ(reload.config.log_level, "debug");
  EXPECT_EQ(reload.config.net.max_clients, 3U);
  EXPECT_EQ(reload.config.hal.camera.backend, "sim");
  // The next reload reports it again, and does not once the file is as before.
  EXPECT_THAT(merge(reload.config, fresh).restart,
              ElementsAre("camera.backend", "ring.brightness"));
  EXPECT_THAT(merge(reload.config, fresh).changed, IsEmpty());
  EXPECT_THAT(merge(reload.config, running).restart, IsEmpty());
}

TEST(Reload, TokensAndTlsChangeFromFileToFileOnly) {
  Config running;
  Config fresh = running;
  fresh.net.token_file = "/etc/dtactd/tokens";
  EXPECT_THAT(merge(running, fresh).restart, ElementsAre("net.tokens"));
  EXPECT_TRUE(merge(running, fresh).config.net.token_file.empty());
  EXPECT_THAT(merge(fresh, running).restart, ElementsAre("net.tokens"));
  Config other = fresh;
  other.net.token_file = "credential:tokens";
  EXPECT_THAT(merge(fresh, other).changed, ElementsAre("net.tokens"));
  EXPECT_EQ(merge(fresh, other).config.net.token_file, "credential:tokens");
}

// The default is another CPU for each daemon of a machine, so its number may be the chosen one's.
TEST(Reload, AChosenCpuIsNotTheDefault) {
  Config running;
  running.cpu_is_default = true;
  Config fresh = running;
  fresh.cpu_is_default = false;
  EXPECT_THAT(merge(running, fresh).restart, ElementsAre("capture.cpu"));
}

// systemd fills $CREDENTIALS_DIRECTORY at a start and, except for version 252, not at a reload: a
// token that was revoked since may still count.
TEST(Reload, SaysThatNewCredentialsNeedARestart) {
  Config config;
  EXPECT_EQ(what_was_read(merge(config, config)), "configuration read again; changed: nothing");
  EXPECT_EQ(what_waits(merge(config, config)), "");
  config.net.tls_certificate = "/etc/dtactd/a.crt";
  config.net.tls_key = "credential:tls-key";
  config.net.token_file = "credential:tokens";
  Config fresh = config;
  fresh.net.max_clients = 3;
  EXPECT_EQ(what_was_read(merge(config, fresh)),
            "configuration read again, and with it the files of net.tls_certificate; changed: "
            "net.max_clients");
  EXPECT_EQ(what_waits(merge(config, fresh)),
            "new credentials need a restart: net.tls_key, net.tokens");
  fresh.net.port = 1;
  EXPECT_EQ(what_waits(merge(config, fresh)),
            "needs a restart: net.port; new credentials need a restart: net.tls_key, "
            "net.tokens");
}

TEST(Reload, EveryLiveKeyIsAKey) {
  Config config;
  int live = 0;
  for (const Key& key : bind_keys(config)) live += is_live(key.path) ? 1 : 0;
  EXPECT_EQ(live, 8);
}

}  // namespace
}  // namespace dtact::app
