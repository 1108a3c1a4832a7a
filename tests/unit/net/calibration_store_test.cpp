#include "daemon/net/calibration_store.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/inotify.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>

#include "hal/base/atomic_file.hpp"
#include "hal/base/unique_fd.hpp"
#include "tests/fakes/file_log.hpp"
#include "tests/unit/calibration/sample.hpp"
#include "tests/unit/net/sample_files.hpp"

namespace dtact::net {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// Numbers of the calibrations that can be read.
std::vector<std::uint64_t> numbers(const std::vector<StoredCalibration>& all) {
  std::vector<std::uint64_t> found;
  for (const auto& stored : all) found.push_back(stored.number);
  return found;
}

std::uint64_t current_of(const std::vector<StoredCalibration>& all) {
  std::uint64_t found = UINT64_MAX;
  for (const auto& stored : all) {
    if (!stored.current) continue;
    EXPECT_EQ(found, UINT64_MAX) << "two are current";
    found = stored.number;
  }
  return found;
}

class Store : public testing::Test {
 protected:
  /// Makes a folder like one of the configuration.
  fs::path make_configured() {
    calibration::save(calibration::sample(), folder_.path() / "factory");
    return folder_.path() / "factory";
  }
  [[nodiscard]] fs::path numbered(int number) const {
    return state_ / "calibrations" / std::to_string(number);
  }

  calibration::TempFolder folder_;
  fs::path state_ = folder_.path() / "state";
  bool made_ = fs::create_directory(state_);
};

TEST_F(Store, IsEmptyAtFirst) {
  FolderCalibrationStore store(state_, {});
  EXPECT_EQ(store.current(), fs::path());
  EXPECT_THAT(store.list(), IsEmpty());
  EXPECT_EQ(store.current_number(), std::nullopt);
  EXPECT_THROW((void)store.read(0), NoSuchCalibration);
  EXPECT_THROW((void)store.read(1), NoSuchCalibration);
  EXPECT_THROW((void)store.load(1, {}), NoSuchCalibration);
  EXPECT_THROW(store.make_current(0), NoSuchCalibration);
  EXPECT_THROW(store.make_current(1), NoSuchCalibration);
}

TEST_F(Store, KeepsFilesUnderTheirName) {
  FolderCalibrationStore store(state_, {});
  EXPECT_EQ(store.keep({"ball", "a toml", "a png"}).number, 1U);
  const auto folder = store.current();
  EXPECT_EQ(folder, numbered(1) / "ball");
  EXPECT_EQ(base::read_file(folder / "calibration.toml"), "a toml");
  EXPECT_EQ(base::read_file(folder / "reference.png"), "a png");
  EXPECT_EQ(fs::canonical(state_ / "calibration"), fs::canonical(folder));
  const auto files = store.read(store.current_number().value());
  EXPECT_EQ(files.number, 1U);
  EXPECT_EQ(files.name, "ball");
  EXPECT_EQ(files.toml, "a toml");
  EXPECT_EQ(files.png, "a png");
}

// Each file before its folder, all of it before it gets its number, and the number before the link.
TEST_F(Store, IsOnTheDiskBeforeItIsConfirmed) {
  FolderCalibrationStore store(state_, {});
  {
    const fakes::FileLog log(state_);
    store.keep(whole("ball"));
    EXPECT_THAT(
        log.calls(),
        ElementsAre("write calibrations/.new/ball/calibration.toml.XXXXXX",
                    "sync calibrations/.new/ball/calibration.toml.XXXXXX",
                    "rename calibrations/.new/ball/calibration.toml.XXXXXX to "
                    "calibrations/.new/ball/calibration.toml",
                    "sync calibrations/.new/ball",
                    "write calibrations/.new/ball/reference.png.XXXXXX",
                    "sync calibrations/.new/ball/reference.png.XXXXXX",
                    "rename calibrations/.new/ball/reference.png.XXXXXX to "
                    "calibrations/.new/ball/reference.png",
                    "sync calibrations/.new/ball", "sync calibrations/.new",
                    "rename calibrations/.new to calibrations/1", "sync calibrations",
                    "write calibrations/recent.XXXXXX", "sync calibrations/recent.XXXXXX",
                    "rename calibrations/recent.XXXXXX to calibrations/recent", "sync calibrations",
                    "rename calibration.new to calibration", "sync ."));
  }
  const fakes::FileLog log(state_);
  store.make_current(1);
  EXPECT_THAT(log.calls(),
              ElementsAre("write calibrations/recent.XXXXXX", "sync calibrations/recent.XXXXXX",
                          "rename calibrations/recent.XXXXXX to calibrations/recent",
                          "sync calibrations", "rename calibration.new to calibration", "sync ."));
}

TEST_F(Store, ListsWhatEachIs) {
  // Users add a trailing slash.
  FolderCalibrationStore store(state_, make_configured() / "");
  store.keep(whole("ball"));
  // date -u -d 2026-01-31T12:00:00Z +%s
  const std::chrono::sys_time<std::chrono::seconds> noon(std::chrono::seconds(1769860800));
  fs::last_write_time(numbered(1) / "ball", fs::file_time_type::clock::from_sys(noon));
  const auto all = store.list();
  ASSERT_THAT(numbers(all), ElementsAre(0, 1));
  EXPECT_EQ(all[0].name, "factory");
  EXPECT_EQ(all[0].uploaded, "");
  EXPECT_FALSE(all[0].current);
  EXPECT_TRUE(all[0].summary.has_value()) << all[0].damage;
  EXPECT_EQ(all[1].name, "ball");
  EXPECT_EQ(all[1].uploaded, "2026-01-31T12:00:00Z");
  EXPECT_TRUE(all[1].current);
  ASSERT_TRUE(all[1].summary.has_value()) << all[1].damage;
  // tests/unit/calibration/sample.hpp has 6x5 pixels of 12x9 and entries -1 … 2 of the LUT.
  EXPECT_EQ(*all[1].summary,
            (CalibrationSummary{
                "ball", "lut", 0.051, 6, 5, -0.01, 0.02, "2026-01-31T12:00:00Z", 12, 9, {1, 2}}));
}

TEST_F(Store, GoesBackToAnEarlierOne) {
  FolderCalibrationStore store(state_, {});
  store.keep(whole("ball"));
  EXPECT_EQ(store.keep(whole("pins")).number, 2U);
  EXPECT_EQ(current_of(store.list()), 2U);
  EXPECT_EQ(store.load(1, {})->name, "ball");
  store.make_current(1);
  EXPECT_EQ(current_of(store.list()), 1U);
  EXPECT_EQ(store.current(), numbered(1) / "ball");
  EXPECT_EQ(store.read(store.current_number().value()).name, "ball");
  EXPECT_EQ(store.read(2).name, "pins");
  EXPECT_EQ(FolderCalibrationStore(state_, {}).current(), store.current());  // after a restart
}

TEST_F(Store, GoesBackToTheConfiguredOne) {
  const fs::path configured = make_configured();
  FolderCalibrationStore store(state_, configured);
  EXPECT_EQ(store.current(), configured);
  EXPECT_EQ(current_of(store.list()), 0U);
  store.keep(whole("ball"));
  EXPECT_EQ(current_of(store.list()), 1U);
  EXPECT_EQ(store.load(0, {})->name, "factory");
  store.make_current(0);
  EXPECT_EQ(current_of(store.list()), 0U);
  EXPECT_EQ(store.read(store.current_number().value()).name, "factory");
  EXPECT_EQ(FolderCalibrationStore(state_, configured).current(), configured);
  EXPECT_TRUE(fs::exists(numbered(1) / "ball"));
  store.make_current(0);  // again changes nothing
  store.make_current(1);
  EXPECT_EQ(store.current(), numbered(1) / "ball");
}

TEST_F(Store, KeepsTheTenUsedLastAndNamesWhatItRemoves) {
  FolderCalibrationStore store(state_, {});
  for (int i = 1; i <= 10; ++i) {
    EXPECT_THAT(store.keep({"ball", std::to_string(i), "p"}).removed, IsEmpty());
  }
  store.make_current(1);
  store.make_current(3);
  const auto kept = store.keep({"ball", "11", "p"});
  EXPECT_EQ(kept.number, 11U);
  ASSERT_THAT(numbers(kept.removed), ElementsAre(2));  // not 1, which was in use since
  EXPECT_EQ(kept.removed[0].name, "ball");
  EXPECT_THAT(kept.removed[0].uploaded, HasSubstr("T"));
  EXPECT_FALSE(fs::exists(numbered(2)));
  // Another run knows the order, too.
  FolderCalibrationStore again(state_, {});
  again.make_current(4);
  EXPECT_THAT(numbers(again.keep({"ball", "12", "p"}).removed), ElementsAre(5));
  EXPECT_THAT(numbers(again.list()), ElementsAre(1, 3, 4, 6, 7, 8, 9, 10, 11, 12));
}

TEST_F(Store, TakesTheOrderOfUploadWhereTheOrderOfUseIsLost) {
  FolderCalibrationStore store(state_, {});
  for (int i = 1; i <= 10; ++i) store.keep({"ball", std::to_string(i), "p"});
  base::write_file_atomically(state_ / "calibrations/recent", "1\n99\n-7 x\n2\n");
  EXPECT_THAT(numbers(store.keep({"ball", "11", "p"}).removed), ElementsAre(2));
  fs::remove(state_ / "calibrations/recent");
  EXPECT_THAT(numbers(store.keep({"ball", "12", "p"}).removed), ElementsAre(1));
}

TEST_F(Store, KeepsPinnedOnes) {
  FolderCalibrationStore store(state_, make_configured());
  store.keep(whole("ball"));
  store.keep(whole("pins"));
  const std::string uploaded = store.list()[1].uploaded;
  store.pin(1, true);
  store.pin(1, true);  // again changes nothing
  EXPECT_TRUE(store.list()[1].pinned);
  EXPECT_FALSE(store.list()[2].pinned);
  EXPECT_EQ(store.list()[1].uploaded, uploaded);
  for (int i = 3; i <= 12; ++i) store.keep({"ball", std::to_string(i), "p"});
  EXPECT_THAT(numbers(store.list()), ElementsAre(0, 1, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12));
  EXPECT_EQ(store.load(1, {})->name, "ball");
  store.pin(1, false);
  store.pin(1, false);
  EXPECT_THAT(numbers(store.keep({"ball", "13", "p"}).removed), ElementsAre(1, 3));
  EXPECT_THROW(store.pin(0, true), std::invalid_argument);
  EXPECT_THROW(store.pin(1, true), NoSuchCalibration);
}

TEST_F(Store, PinsSoManyAndNoMore) {
  FolderCalibrationStore store(state_, {});
  for (std::uint64_t i = 1; i <= 21; ++i) {
    store.keep({"ball", "t", "p"});
    if (i <= 20) store.pin(i, true);
  }
  EXPECT_THROW(store.pin(21, true), std::invalid_argument);
  store.pin(7, false);
  EXPECT_NO_THROW(store.pin(21, true));
}

TEST_F(Store, GivesNoNumberTwice) {
  FolderCalibrationStore store(state_, make_configured());
  for (int i = 1; i <= 25; ++i) store.keep({"ball", "t", "p"});
  store.make_current(16);
  FolderCalibrationStore again(state_, {});
  again.keep({"ball", "t", "p"});
  EXPECT_EQ(again.read(again.current_number().value()).number, 26U);
  again.make_current(18);
  again.keep({"ball", "t", "p"});
  EXPECT_EQ(again.read(again.current_number().value()).number, 27U);
}

TEST_F(Store, ListsADamagedOneWithTheReason) {
  FolderCalibrationStore store(state_, {});
  store.keep(whole("ball"));
  store.keep(whole("pins"));
  store.keep(whole("left"));
  store.keep(whole("right"));
  fs::remove(numbered(1) / "ball/reference.png");
  base::write_file_atomically(numbered(2) / "pins/calibration.toml", "version = 1\n");
  fs::remove_all(numbered(4) / "right");
  const auto all = store.list();
  ASSERT_THAT(numbers(all), ElementsAre(1, 2, 3, 4));
  EXPECT_EQ(all[0].name, "ball");
  EXPECT_FALSE(all[0].summary.has_value());
  EXPECT_THAT(all[0].damage, HasSubstr("1/ball/reference.png"));
  EXPECT_THAT(all[1].damage, HasSubstr("2/pins/calibration.toml:1: method: missing"));
  EXPECT_TRUE(all[2].summary.has_value());
  EXPECT_EQ(all[2].damage, "");
  EXPECT_TRUE(all[3].current);
  EXPECT_THAT(all[3].damage, HasSubstr("calibrations/4: holds 0 folders"));
}

/// Counts how often files of one folder are opened.
class Opened {
 public:
  explicit Opened(const fs::path& folder) : fd_(::inotify_init1(IN_CLOEXEC | IN_NONBLOCK)) {
    EXPECT_GE(::inotify_add_watch(fd_.get(), folder.c_str(), IN_OPEN), 0) << folder;
  }
  /// Number since the last call, without folders.
  [[nodiscard]] int files() const {
    int count = 0;
    alignas(inotify_event) std::array<char, 4096> events{};
    for (ssize_t size = 0; (size = ::read(fd_.get(), events.data(), events.size())) > 0;) {
      for (ssize_t at = 0; at < size;) {
        const auto* event = reinterpret_cast<const inotify_event*>(events.data() + at);
        if ((event->mask & IN_ISDIR) == 0) ++count;
        at += static_cast<ssize_t>(sizeof *event + event->len);
      }
    }
    return count;
  }

 private:
  base::UniqueFd fd_;
};

// Repeated requests for the list must not keep the processor from the frames.
TEST_F(Store, ReadsForTheListWhatHasChanged) {
  const fs::path configured = make_configured();
  FolderCalibrationStore store(state_, configured);
  store.keep(whole("ball"));
  const fs::path toml = numbered(1) / "ball/calibration.toml";
  const Opened uploaded(numbered(1) / "ball");
  const Opened factory(configured);
  const auto first = store.list();
  EXPECT_EQ(uploaded.files(), 2);
  EXPECT_EQ(factory.files(), 2);
  const auto second = store.list();
  EXPECT_EQ(uploaded.files(), 0);
  EXPECT_EQ(factory.files(), 0);
  ASSERT_EQ(second.size(), 2U);
  EXPECT_EQ(second[0].summary, first[0].summary);
  EXPECT_EQ(second[1].summary, first[1].summary);

  // A program cannot hide a change in place of the same size with the time set back.
  const auto time = fs::last_write_time(toml);
  std::string text = base::read_file(toml);
  text.replace(text.find("version = 1"), 11, "version = 9");
  std::ofstream(toml) << text;
  fs::last_write_time(toml, time);
  (void)uploaded.files();
  EXPECT_THAT(store.list()[1].damage, HasSubstr("version"));
  EXPECT_GT(uploaded.files(), 0);
  // A damaged one is read each time.
  EXPECT_THAT(store.list()[1].damage, HasSubstr("version"));
  EXPECT_GT(uploaded.files(), 0);
  EXPECT_EQ(factory.files(), 0);
}

// Reading a calibration for the list takes as long as reading it for use.
TEST_F(Store, ListsAfterAStartWhatItAcceptedByItsDigests) {
  {
    FolderCalibrationStore store(state_, {});
    const CalibrationFiles files = whole("ball");
    (void)store.check(files, {});
    store.keep(files);
    store.keep(whole("pins"));  // accepted: of the same bytes
    store.keep({"other", "never checked", "p"});
  }
  const fs::path toml = numbered(1) / "ball/calibration.toml";
  const fs::path record = numbered(1) / "accepted.toml";
  const std::string before = calibration::sha256_hex(base::read_file(toml));
  std::string text = base::read_file(record);
  {
    const auto all = FolderCalibrationStore(state_, {}).list();
    ASSERT_THAT(numbers(all), ElementsAre(1, 2, 3));
    EXPECT_EQ(*all[0].summary,
              (CalibrationSummary{
                  "ball", "lut", 0.051, 6, 5, -0.01, 0.02, "2026-01-31T12:00:00Z", 12, 9, {1, 2}}));
    EXPECT_EQ(all[1].summary->name, "pins");
    EXPECT_THAT(all[2].damage, HasSubstr("3/other/calibration.toml:1"));
  }
  // Other files than those accepted are read; with their digest they would not be.
  base::write_file_atomically(toml, "no calibration");
  EXPECT_THAT(FolderCalibrationStore(state_, {}).list()[0].damage, HasSubstr("calibration.toml:1"));
  text.replace(text.find(before), before.size(), calibration::sha256_hex("no calibration"));
  base::write_file_atomically(record, text);
  EXPECT_EQ(FolderCalibrationStore(state_, {}).list()[0].damage, "");
  base::write_file_atomically(record, "no record");
  EXPECT_THAT(FolderCalibrationStore(state_, {}).list()[0].damage, HasSubstr("calibration.toml:1"));
}

TEST_F(Store, PassesOverOneThatStartsDoNotSurvive) {
  const fs::path configured = make_configured();
  (void)FolderCalibrationStore(state_, configured).keep(whole("ball"));
  for (int i = 0; i < 2; ++i) {
    EXPECT_TRUE(FolderCalibrationStore(state_, configured).begin_start()) << i;
  }
  {
    FolderCalibrationStore store(state_, configured);  // one that does is enough
    EXPECT_TRUE(store.begin_start());
    store.end_start();
  }
  for (int i = 0; i < 3; ++i) {
    FolderCalibrationStore store(state_, configured);
    EXPECT_TRUE(store.begin_start()) << i;
    EXPECT_EQ(store.started_number(), 1U);
  }
  for (int i = 0; i < 2; ++i) {
    FolderCalibrationStore store(state_, configured);
    EXPECT_FALSE(store.begin_start());
    store.end_start();  // of a start without it: it stays passed over
    EXPECT_EQ(store.started_number(), 0U);
    EXPECT_EQ(store.current_number(), 1U);
    EXPECT_EQ(store.read(1).name, "ball");
  }
  {
    FolderCalibrationStore store(state_, {});
    EXPECT_FALSE(store.begin_start());
    EXPECT_EQ(store.started_number(), std::nullopt);
    store.make_current(1);  // tries it again
  }
  FolderCalibrationStore store(state_, configured);
  EXPECT_TRUE(store.begin_start());
  store.keep(whole("pins"));  // another one has not failed
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(FolderCalibrationStore(state_, configured).begin_start());
  store.make_current(0);
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(FolderCalibrationStore(state_, configured).begin_start());
}

TEST_F(Store, RefusesToLoadADamagedOne) {
  FolderCalibrationStore store(state_, {});
  store.keep(whole("ball"));
  store.keep(whole("pins"));
  base::write_file_atomically(numbered(1) / "ball/calibration.toml", "version = 1\n");
  EXPECT_THROW((void)store.load(1, {}), std::runtime_error);
  EXPECT_EQ(current_of(store.list()), 2U);
  EXPECT_EQ(store.read(1).toml, "version = 1\n");  // its files can be read
}

TEST_F(Store, PassesOverWhatIsNotItsOwn) {
  FolderCalibrationStore store(state_, {});
  store.keep(whole("ball"));
  for (const char* name : {"0", "02", "-3", "4 ", "notes", "99999999999999999999"}) {
    fs::create_directory(state_ / "calibrations" / name);
  }
  EXPECT_THAT(numbers(store.list()), ElementsAre(1));
  store.keep(whole("pins"));
  EXPECT_THAT(numbers(store.list()), ElementsAre(1, 2));
  EXPECT_TRUE(fs::exists(state_ / "calibrations/notes"));
}

// Before: the daemon waited for ever for somebody to write into them.
TEST_F(Store, PipesInPlaceOfItsFilesAreNotWaitedFor) {
  FolderCalibrationStore store(state_, {});
  store.keep(whole("ball"));
  for (const fs::path& file :
       {numbered(1) / "ball/calibration.toml", numbered(1).parent_path() / "recent",
        state_ / "calibration.starts"}) {
    fs::remove(file);
    ASSERT_EQ(::mkfifo(file.c_str(), 0600), 0);
  }
  EXPECT_TRUE(FolderCalibrationStore(state_, {}).begin_start());
  EXPECT_NE(store.list().at(0).damage, "");
  store.keep(whole("pins"));
  EXPECT_THAT(numbers(store.list()), ElementsAre(1, 2));
}

TEST_F(Store, HasNoNumberWhereTheLinkLeadsElsewhere) {
  FolderCalibrationStore store(state_, {});
  fs::create_directory_symlink(make_configured(), state_ / "calibration");
  EXPECT_EQ(store.current(), folder_.path() / "factory");  // set by an administrator
  EXPECT_EQ(store.current_number(), std::nullopt);
}

// Before: its folder was taken for the mark of a pin, so none was ever removed.
TEST_F(Store, ACalibrationOfAnyNameCanBePinned) {
  FolderCalibrationStore store(state_, {});
  for (int i = 1; i <= 12; ++i) store.keep({"pinned", std::to_string(i), "p"});
  EXPECT_THAT(numbers(store.list()), ElementsAre(3, 4, 5, 6, 7, 8, 9, 10, 11, 12));
  EXPECT_FALSE(store.list().back().pinned);
  store.pin(12, true);
  EXPECT_TRUE(store.list().back().pinned);
  store.pin(12, false);
  EXPECT_FALSE(store.list().back().pinned);
}

TEST_F(Store, FailsWhereItCannotWrite) {
  base::write_file_atomically(state_ / "no", "a file");
  FolderCalibrationStore store(state_ / "no", {});
  EXPECT_THROW(store.keep({"ball", "1", "p"}), std::exception);
}

TEST_F(Store, RefusesWhatIsNoCalibration) {
  FolderCalibrationStore store(state_, {});
  EXPECT_THROW((void)store.check({"ball", "this is no toml", "this is no png"}, {}),
               std::runtime_error);
  EXPECT_EQ(store.check(whole("ball"), {})->name, "ball");
  EXPECT_EQ(store.current(), fs::path());
}

}  // namespace
}  // namespace dtact::net
