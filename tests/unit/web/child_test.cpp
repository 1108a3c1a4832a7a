// A child process that speaks lines.
#include "clients/web/guided/child.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <boost/asio/io_context.hpp>
#include <csignal>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

namespace dtact::web {
namespace {

using testing::ElementsAre;

struct Received {
  std::vector<std::string> lines;
  std::optional<int> status;
  std::string errors;
};

/// Runs a shell script to its end. Calls `with` once the script runs.
template <typename With>
Received run(const std::string& script, const std::string& secret, With&& with) {
  boost::asio::io_context io;
  Received received;
  const auto child = std::make_shared<Child>(io.get_executor());
  child->start({"sh", "-c", script}, secret,
               {.line = [&](std::string line) { received.lines.push_back(std::move(line)); },
                .ended =
                    [&](int status, const std::string& errors) {
                      received.status = status;
                      received.errors = errors;
                    }});
  EXPECT_TRUE(child->runs());
  with(*child);
  io.run();
  EXPECT_FALSE(child->runs());
  return received;
}

TEST(Child, IsTypedLinesAndAnswersInThem) {
  const Received received =
      run("read a; read b; echo \"$b\"; echo \"$a\"; echo why >&2; exit 3", "", [](Child& child) {
        EXPECT_TRUE(child.type("first"));
        EXPECT_TRUE(child.type("second one"));
      });
  EXPECT_THAT(received.lines, ElementsAre("second one", "first"));
  ASSERT_TRUE(received.status.has_value());
  EXPECT_EQ(WEXITSTATUS(*received.status), 3);
  EXPECT_EQ(received.errors, "why\n");
}

TEST(Child, ReadsASecretThatNobodyElseCan) {
  const Received received =
      run("cat /proc/self/fd/3; echo; stat -Lc %a /proc/self/fd/3", "gripper-token", [](Child&) {});
  EXPECT_THAT(received.lines, ElementsAre("gripper-token", "600"));
}

TEST(Child, HasNoneOfOurOtherFiles) {
  std::array<int, 2> ours{};  // stay open over exec, like Asio's sockets
  ASSERT_EQ(::pipe(ours.data()), 0);
  const std::string list = "exec ls /proc/self/fd";  // the last is the folder that it reads
  EXPECT_THAT(run(list, "secret", [](Child&) {}).lines, ElementsAre("0", "1", "2", "3", "4"));
  EXPECT_THAT(run(list, "", [](Child&) {}).lines, ElementsAre("0", "1", "2", "3"));
  for (const int end : ours) ::close(end);
}

TEST(Child, TakesNoMoreThanItIsBoundTo) {
  (void)run("exec sleep 60", "", [](Child& child) {
    const std::string line(4096, 'x');
    int taken = 0;
    while (taken < 1000 && child.type(line)) ++taken;
    EXPECT_GE(taken, 15);
    EXPECT_LE(taken, 17) << "one on its way, 64 KiB waiting";
    child.end();
  });
}

// Behind what is on its way: 64 KiB, the newlines of earlier lines among them.
TEST(Child, LinesThatWaitMayHave64KiB) {
  (void)run("exec sleep 60", "", [](Child& child) {
    EXPECT_TRUE(child.type("on its way"));
    EXPECT_FALSE(child.type(std::string(65537, 'x')));
    EXPECT_TRUE(child.type(std::string(65534, 'x')));
    EXPECT_FALSE(child.type("xy"));
    EXPECT_TRUE(child.type("x"));
    child.end();
  });
}

TEST(Child, ALineMayHave8MiBWithItsNewline) {
  const Received whole = run("head -c 8388607 /dev/zero | tr '\\0' x; echo", "", [](Child&) {});
  EXPECT_THAT(whole.lines, ElementsAre(testing::SizeIs(8388607)));
  EXPECT_EQ(*whole.status, 0);
  const Received longer =
      run("head -c 8388608 /dev/zero | tr '\\0' x; echo; exec sleep 60", "", [](Child&) {});
  EXPECT_THAT(longer.lines, ElementsAre());
  EXPECT_EQ(WTERMSIG(*longer.status), SIGKILL);
}

TEST(Child, IsEndedAlsoWhereItWillNot) {
  const Received received = run("exec sleep 60", "", [](Child& child) { child.end(); });
  EXPECT_EQ(WTERMSIG(*received.status), SIGTERM);
  // The trap is set once the script prints.
  boost::asio::io_context io;
  const auto deaf = std::make_shared<Child>(io.get_executor());
  std::optional<int> status;
  deaf->start({"sh", "-c", "trap '' TERM; echo deaf; while :; do sleep 0.1; done"}, "",
              {.line = [&](const std::string&) { deaf->end(); },
               .ended = [&](int how, const std::string&) { status = how; }});
  io.run();
  ASSERT_TRUE(status.has_value());
  EXPECT_EQ(WTERMSIG(*status), SIGKILL);
}

TEST(Child, KeepsTheEndOfALongComplaint) {
  const Received received = run("seq 1 5000 >&2; echo last >&2; exit 1", "", [](Child&) {});
  EXPECT_LE(received.errors.size(), 2000U);
  EXPECT_TRUE(received.errors.ends_with("5000\nlast\n"));
}

TEST(Child, Keeps2000BytesOfAComplaint) {
  const std::string whole =
      run("printf a >&2; head -c 1999 /dev/zero | tr '\\0' x >&2", "", [](Child&) {}).errors;
  EXPECT_EQ(whole, "a" + std::string(1999, 'x'));
  const std::string end =
      run("printf ab >&2; head -c 1999 /dev/zero | tr '\\0' x >&2", "", [](Child&) {}).errors;
  EXPECT_EQ(end, "b" + std::string(1999, 'x'));
}

TEST(Child, SaysThatAProgramIsNotThere) {
  boost::asio::io_context io;
  const auto child = std::make_shared<Child>(io.get_executor());
  EXPECT_THROW(child->start({"/nowhere/dtact"}, "", {}), std::system_error);
}

}  // namespace
}  // namespace dtact::web
