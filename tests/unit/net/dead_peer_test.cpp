// A client that stops reading is kept; a dead one is dropped.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <net/if.h>
#include <sched.h>
#include <sys/ioctl.h>

#include <cerrno>
#include <cstring>
#include <memory>
#include <thread>

#include "daemon/serve/tcp_watch.hpp"
#include "tests/unit/net/raw_client.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::net::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;
using testing::Not;
using Clock = PeerJudge::Clock;

constexpr int kSmallBuffer = 4096;
constexpr milliseconds kDeadAfter{3000};

/// The judge of a connection that is as old as `Clock`, with a limit of thirty seconds.
class Judged : public ::testing::Test {
 protected:
  bool alive(seconds now, TcpProgress progress) {
    return judge_.alive(progress, Clock::time_point(now));
  }
  PeerJudge judge_{seconds(30), Clock::time_point()};
};

TEST_F(Judged, IsAliveWhileItTakesWhatItIsSent) {
  for (int s = 0; s < 600; s += 2) {
    ASSERT_TRUE(alive(seconds(s), {true, static_cast<std::uint64_t>(s + 1), milliseconds(2900)}));
    ASSERT_EQ(judge_.user_timeout(), seconds(30));
  }
}

TEST_F(Judged, IsAliveThoughItHasSaidNothingForHours) {
  EXPECT_TRUE(alive(seconds(7200), {false, 5, seconds(7200)}));
  // Now something is sent, and the check comes before the answer.
  EXPECT_TRUE(alive(seconds(7202), {true, 5, seconds(7202)}));
}

TEST_F(Judged, IsAliveWhileItAnswersProbesAndTakesNothing) {
  EXPECT_TRUE(alive(seconds(0), {false, 5, seconds(0)}));
  for (int s = 2; s < 3600; s += 2) {
    ASSERT_TRUE(alive(seconds(s), {true, 5, seconds(s % 22)})) << s;
    // The timeout grows, so that the kernel never reaches it.
    ASSERT_EQ(judge_.user_timeout(), seconds(s) + milliseconds(11'250));
  }
}

TEST_F(Judged, IsGoneWhenItAnswersNoMore) {
  EXPECT_TRUE(alive(seconds(0), {false, 5, seconds(0)}));
  EXPECT_TRUE(alive(seconds(22), {true, 5, seconds(22)}));
  EXPECT_FALSE(alive(seconds(23), {true, 5, seconds(23)}));
}

TEST_F(Judged, IsGoneWhenItAnswersNoMoreAfterItStoppedReading) {
  EXPECT_TRUE(alive(seconds(0), {false, 5, seconds(0)}));
  EXPECT_TRUE(alive(seconds(300), {true, 5, seconds(1)}));
  EXPECT_FALSE(alive(seconds(322), {true, 5, seconds(23)}));
}

void publish_for(Rig& rig, milliseconds time, std::uint64_t& sequence) {
  const auto end = Clock::now() + time;
  while (Clock::now() < end) {
    rig.port.publish(make_frame(++sequence, 800, 600));
    // A frame that the next one replaces on a busy machine is not missed by the reader.
    EXPECT_TRUE(rig.port.wait_fetched());
    std::this_thread::sleep_for(milliseconds(20));
  }
}

/// Number of frames encoded since the start; the reply to `asking` follows all frames before it.
std::uint64_t encoded(RawClient& asking) {
  v1::ClientMessage message;
  message.mutable_get_status();
  return asking.request(message).status().encoded();
}

// NOLINTBEGIN(misc-const-correctness): clang-tidy 19 takes clients that send for constants
// The kernel cannot tell a stopped program from one that does not read.
TEST(StoppedReader, IsKeptAndReportedWhatItMissed) {
  NetConfig config;
  config.peer_timeout = kDeadAfter;
  Rig rig(config);
  RawClient stopped(rig.tcp_port(), kSmallBuffer);
  stopped.hello();
  stopped.subscribe(v1::DEPTH_INT16);
  std::uint64_t sequence = 0;
  // TCP_USER_TIMEOUT alone ends it after kDeadAfter.
  publish_for(rig, 3 * kDeadAfter, sequence);
  rig.port.emit(pipeline::ReferenceTaken{true, {}});
  EXPECT_THAT(rig.log(), Not(HasSubstr("disconnected")));
  EXPECT_EQ(stopped.frame().sequence(), 1U);
  EXPECT_GT(encoded(stopped), 60U);
  // Frames that waited while it was stopped are old, and are not sent.
  rig.port.publish(make_frame(++sequence, 800, 600));
  const auto frame = stopped.frame();
  EXPECT_EQ(frame.sequence(), sequence);
  EXPECT_EQ(frame.dropped(), sequence - 2);
}

// The second frame waits, the next 60 replace each other, and then encoding stops.
TEST(StoppedReader, IsNotMadeFramesForUntilItReadsOn) {
  Rig rig;
  RawClient asking(rig.tcp_port());
  asking.hello();
  RawClient stopped(rig.tcp_port(), kSmallBuffer);
  stopped.hello();
  stopped.subscribe(v1::DEPTH_INT16);
  std::uint64_t sequence = 0;
  for (; sequence < 100; ++sequence) {
    rig.port.publish(make_frame(sequence + 1, 800, 600));
    ASSERT_TRUE(rig.port.wait_fetched());
  }
  EXPECT_EQ(encoded(asking), 62U);

  EXPECT_EQ(stopped.frame().sequence(), 1U);
  EXPECT_EQ(encoded(stopped), 62U);
  rig.port.publish(make_frame(++sequence, 800, 600));
  const auto frame = stopped.frame();
  EXPECT_EQ(frame.sequence(), 101U);
  EXPECT_EQ(frame.dropped(), 99U);
  EXPECT_EQ(encoded(asking), 63U);
}

TEST(StoppedReader, IsOwedNothingOfASubscriptionThatItHasLeft) {
  Rig rig;
  RawClient stopped(rig.tcp_port(), kSmallBuffer);
  stopped.hello();
  v1::ClientMessage both;
  both.mutable_subscribe()->set_depth(v1::DEPTH_INT16);
  both.mutable_subscribe()->set_jpeg(true);
  ASSERT_TRUE(stopped.request(both).has_done());
  auto frame = make_frame(1, 800, 600);
  frame.has_jpeg = true;
  frame.jpeg.assign(1000, 7);
  for (frame.camera.sequence = 1; frame.camera.sequence <= 100; ++frame.camera.sequence) {
    rig.port.publish(frame);
    ASSERT_TRUE(rig.port.wait_fetched());
  }
  v1::ClientMessage depth;
  depth.set_id(2);
  depth.mutable_subscribe()->set_depth(v1::DEPTH_INT16);
  stopped.send(depth);
  EXPECT_TRUE(stopped.frame().has_jpeg());
  EXPECT_TRUE(stopped.reply().has_done());

  rig.port.publish(frame);
  const auto next = stopped.frame();
  EXPECT_TRUE(next.has_depth());
  EXPECT_FALSE(next.has_jpeg());
}

/// The thread gets its own network namespace with only loopback, and returns at the end.
class OwnNetwork {
 public:
  OwnNetwork() : before_(::open("/proc/thread-self/ns/net", O_RDONLY | O_CLOEXEC)) {
    made_ = ::unshare(CLONE_NEWNET) == 0;
    if (!made_) return;
    control_ = base::UniqueFd(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    up(true);
  }
  ~OwnNetwork() {
    if (made_) (void)::setns(before_.get(), CLONE_NEWNET);
  }
  OwnNetwork(const OwnNetwork&) = delete;
  OwnNetwork& operator=(const OwnNetwork&) = delete;

  [[nodiscard]] bool made() const { return made_; }
  /// Down: data is dropped without an error.
  void up(bool on) const {
    ifreq request{};
    std::strcpy(request.ifr_name, "lo");
    request.ifr_flags = static_cast<short>(on ? IFF_UP | IFF_RUNNING : 0);
    if (::ioctl(control_.get(), SIOCSIFFLAGS, &request) != 0) throw std::runtime_error("lo");
  }

 private:
  base::UniqueFd before_;
  bool made_ = false;
  base::UniqueFd control_;
};

class DeadPeer : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!network_.made()) {
      GTEST_SKIP() << "no network namespace can be made here: " << std::strerror(errno);
    }
    config_.peer_timeout = kDeadAfter;
  }
  OwnNetwork network_;
  NetConfig config_;
};

TEST_F(DeadPeer, IsLetGoInTheMiddleOfFrames) {
  Rig rig(config_);
  RawClient client(rig.tcp_port());
  client.hello();
  client.subscribe(v1::DEPTH_INT16);
  rig.port.publish(make_frame(1, 800, 600));
  EXPECT_EQ(client.frame().sequence(), 1U);
  network_.up(false);
  rig.port.publish(make_frame(2, 800, 600));
  EXPECT_TRUE(rig.wait_log("disconnected: Connection timed out"));
}

TEST_F(DeadPeer, IsLetGoAfterItStoppedReading) {
  Rig rig(config_);
  RawClient client(rig.tcp_port(), kSmallBuffer);
  client.hello();
  client.subscribe(v1::DEPTH_INT16);
  std::uint64_t sequence = 0;
  publish_for(rig, 2 * kDeadAfter, sequence);
  ASSERT_THAT(rig.log(), Not(HasSubstr("disconnected")));
  network_.up(false);
  EXPECT_TRUE(rig.wait_log("disconnected: Connection timed out"));
}

TEST_F(DeadPeer, IsLetGoWhileNothingIsSent) {
  Rig rig(config_);
  RawClient client(rig.tcp_port());
  client.hello();
  network_.up(false);
  EXPECT_TRUE(rig.wait_log("disconnected: "));
}
// NOLINTEND(misc-const-correctness)

}  // namespace
}  // namespace dtact::net::test
