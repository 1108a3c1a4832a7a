// The store is stopped before each of its system calls in turn, like a power cut.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/ptrace.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "daemon/net/calibration_store.hpp"
#include "tests/unit/calibration/sample.hpp"
#include "tests/unit/net/sample_files.hpp"

namespace dtact::net {
namespace {

namespace fs = std::filesystem;

/// Runs `work` in a process of its own and kills it before its n-th system call (from 1). True when
/// it ended before that; nothing when processes cannot be traced here.
std::optional<bool> run_until(int n, const std::function<void()>& work) {
  const pid_t child = ::fork();
  if (child == 0) {
    if (::ptrace(PTRACE_TRACEME, 0, nullptr, nullptr) != 0) ::_exit(2);
    ::raise(SIGSTOP);
    work();
    ::_exit(0);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  if (!WIFSTOPPED(status)) return std::nullopt;
  // The child stops when it enters and when it leaves a call; the first stop is raise()'s return.
  for (int stop = 0; stop < 2 * n; ++stop) {
    ::ptrace(PTRACE_SYSCALL, child, nullptr, nullptr);
    ::waitpid(child, &status, 0);
    if (WIFEXITED(status)) return true;
  }
  ::kill(child, SIGKILL);
  ::waitpid(child, &status, 0);
  return false;
}

class Crash : public testing::Test {
 protected:
  Crash() {
    fs::create_directory(start_);
    FolderCalibrationStore store(start_, {});
    // With one more, the oldest is removed.
    for (std::size_t i = 0; i < FolderCalibrationStore::kKept; ++i) store.keep(whole("old"));
    store.make_current(3);
  }

  /// Stops `work` before each call, each time from the same state, and checks the result.
  void stop_everywhere(const std::function<void(FolderCalibrationStore&)>& work,
                       std::uint64_t before, std::uint64_t after) {
    bool was_before = false;
    for (int n = 1;; ++n) {
      fs::remove_all(state_);
      fs::copy(start_, state_, fs::copy_options::recursive | fs::copy_options::copy_symlinks);
      const auto ended = run_until(n, [&] {
        FolderCalibrationStore store(state_, {});
        work(store);
      });
      if (!ended) GTEST_SKIP() << "processes cannot be traced here";
      const std::uint64_t current = check(n);
      EXPECT_TRUE(current == before || current == after) << current;
      was_before = was_before || current == before;
      if (!*ended) continue;
      EXPECT_EQ(current, after);
      EXPECT_TRUE(was_before);
      EXPECT_GT(n, 5);
      return;
    }
  }

  // In memory, where syncing costs nothing.
  calibration::TempFolder folder_{fs::is_directory("/dev/shm") ? "/dev/shm"
                                                               : fs::temp_directory_path()};
  fs::path start_ = folder_.path() / "start";
  fs::path state_ = folder_.path() / "state";

 private:
  /// Checks the whole store and returns the number of the current calibration.
  std::uint64_t check(int n) {
    FolderCalibrationStore store(state_, {});
    std::uint64_t current = 0;
    const auto all = store.list();
    for (const auto& stored : all) {
      EXPECT_EQ(stored.damage, "") << "stopped before call " << n;
      if (stored.current) current = stored.number;
    }
    EXPECT_EQ(store.read(store.current_number().value()).number, current);
    // The next upload works, under a new number.
    store.keep(whole("next"));
    EXPECT_EQ(store.read(store.current_number().value()).number, all.back().number + 1)
        << "stopped before call " << n;
    // The file with the order of their use is one more.
    const auto entries = std::distance(fs::directory_iterator(state_ / "calibrations"), {});
    EXPECT_LE(entries, static_cast<std::ptrdiff_t>(FolderCalibrationStore::kKept) + 1)
        << "stopped before call " << n;
    return current;
  }
};

TEST_F(Crash, LeavesAWholeCalibrationDuringAnUpload) {
  const CalibrationFiles fresh = whole("new");
  stop_everywhere([&](FolderCalibrationStore& store) { store.keep(fresh); }, 3, 11);
}

TEST_F(Crash, LeavesAWholeCalibrationDuringAnActivation) {
  stop_everywhere([](FolderCalibrationStore& store) { store.make_current(7); }, 3, 7);
}

}  // namespace
}  // namespace dtact::net
