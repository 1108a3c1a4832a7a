#include "clients/recording/part_file_sink.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>

#include <filesystem>
#include <stdexcept>

#include "hal/base/atomic_file.hpp"
#include "tests/fakes/own_path.hpp"

namespace dtact::recording {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::ThrowsMessage;

class PartFile : public testing::Test {
 protected:
  PartFile() { fs::create_directories(folder_); }

 public:
  ~PartFile() override { fs::remove_all(folder_); }

 protected:
  [[nodiscard]] std::string read() const { return base::read_file(file_); }

  fs::path folder_ = fakes::own_path();
  std::string file_ = folder_ / "press.mcap";
  std::string part_ = file_ + ".part";
};

TEST_F(PartFile, TheEarlierFileStaysUntilTheNameIsGiven) {
  base::write_file_atomically(file_, "earlier");
  {
    PartFileSink sink(file_, true);
    sink.append("lost");
  }
  EXPECT_EQ(read(), "earlier");
  EXPECT_FALSE(fs::exists(part_));
  PartFileSink sink(file_, true);
  sink.append("ne");
  sink.give_name();
  sink.append("w");
  EXPECT_EQ(read(), "new");
  EXPECT_FALSE(fs::exists(part_));
}

TEST_F(PartFile, AFileIsNotReplacedUnasked) {
  PartFileSink sink(file_, false);
  base::write_file_atomically(file_, "another program's");
  EXPECT_THAT([&] { sink.give_name(); },
              ThrowsMessage<std::runtime_error>(HasSubstr("File exists")));
  EXPECT_THAT([&] { const PartFileSink again(file_, false); },
              ThrowsMessage<std::runtime_error>(HasSubstr("add --force")));
  EXPECT_EQ(read(), "another program's");
}

// Before: a recording that was killed before its first frame kept each later one from beginning.
TEST_F(PartFile, APartThatNobodyWritesIsReplaced) {
  base::write_file_atomically(part_, "of a killed program, longer than what comes");
  PartFileSink sink(file_, false);
  sink.append("new");
  sink.give_name();
  EXPECT_EQ(read(), "new");
}

// Before: --force emptied it while the other program wrote.
TEST_F(PartFile, APartThatAnotherProgramWritesIsLeft) {
  base::write_file_atomically(part_, "of another program");
  const base::UniqueFd other(::open(part_.c_str(), O_RDONLY | O_CLOEXEC));
  ASSERT_EQ(::flock(other.get(), LOCK_EX | LOCK_NB), 0);
  for (const bool replace : {false, true}) {
    EXPECT_THAT([&] { const PartFileSink sink(file_, replace); },
                ThrowsMessage<std::runtime_error>(HasSubstr("another program is writing it")));
  }
  EXPECT_EQ(base::read_file(part_), "of another program");
}

TEST_F(PartFile, ALinkStaysOne) {
  const fs::path there = folder_ / "there.mcap";
  base::write_file_atomically(there, "earlier");
  fs::create_symlink(there, file_);
  PartFileSink sink(file_, true);
  sink.append("new");
  sink.give_name();
  EXPECT_TRUE(fs::is_symlink(file_));
  EXPECT_EQ(base::read_file(there), "new");
}

}  // namespace
}  // namespace dtact::recording
