// The doctor's findings about the board and the system.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/unit/doctor/fake_machine.hpp"

namespace dtact::app::test {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

TEST(DoctorCoreClock, IsOfInterestOnARaspberryPi4) {
  SpiMachine machine;
  EXPECT_THAT(check_core_clock(machine, spi_ring()), IsEmpty());
  machine.file("/proc/device-tree/model", "Raspberry Pi 4 Model B Rev 1.4");
  machine.file("/boot/firmware/config.txt", "dtparam=spi=on\n#core_freq_min=500\n");
  const Finding finding = only_trouble(check_core_clock(machine, spi_ring()));
  EXPECT_EQ(finding.verdict, Verdict::note);
  EXPECT_THAT(finding.fix, HasSubstr("core_freq=500\\ncore_freq_min=500"));
  machine.answers = {{"measure_clock core", "frequency(1)=200000992"}};
  EXPECT_THAT(only_trouble(check_core_clock(machine, spi_ring())).what,
              HasSubstr("moves with load, now 200 MHz"));
  for (const char* config : {"core_freq=500\ncore_freq_min=500\n", "force_turbo=1\n"}) {
    machine.file("/boot/firmware/config.txt", config);
    EXPECT_TRUE(all_good(check_core_clock(machine, spi_ring()))) << config;
  }
  // A key that only begins with the same letters is another setting.
  machine.file("/boot/firmware/config.txt", "core_freq_min=5000\n");
  EXPECT_EQ(only_trouble(check_core_clock(machine, spi_ring())).verdict, Verdict::note);
  machine.file("/proc/device-tree/model", "Raspberry Pi 5 Model B Rev 1.0");
  EXPECT_THAT(check_core_clock(machine, spi_ring()), IsEmpty());
}

TEST(DoctorPower, DecodesTheFirmwaresBits) {
  PiMachine machine;
  machine.answers = {{"get_throttled", "throttled=0x0"}};
  EXPECT_TRUE(all_good(check_throttling(machine)));
  // Throttled for under-voltage now; the processor's clock was capped before.
  machine.answers = {{"get_throttled", "throttled=0x70005"}};
  const Findings findings = check_throttling(machine);
  ASSERT_THAT(findings, SizeIs(3));
  EXPECT_EQ(findings[0].verdict, Verdict::wrong);
  EXPECT_EQ(findings[0].what, "throttled=0x70005: under-voltage now");
  EXPECT_THAT(findings[0].fix, HasSubstr("vcgencmd get_throttled"));
  EXPECT_EQ(findings[1].verdict, Verdict::note);
  EXPECT_EQ(findings[1].what, "throttled=0x70005: processor clock capped since the board started");
  EXPECT_EQ(findings[2].what, "throttled=0x70005: throttled now");
  machine.answers = {{"get_throttled", "throttled=0x80008"}};
  EXPECT_EQ(only_trouble(check_throttling(machine)).what,
            "throttled=0x80008: soft temperature limit now");
}

TEST(DoctorPower, IsAskedOfARaspberryPiOnly) {
  const FakeMachine other;
  EXPECT_THAT(check_throttling(other), IsEmpty());
  const PiMachine silent;
  EXPECT_EQ(only_trouble(check_throttling(silent)).verdict, Verdict::note);
}

TEST(DoctorGroups, AMissingOneIsNamed) {
  FakeMachine machine;
  machine.file("/etc/group", "root:x:0:\nvideo:x:44:anna\nspi:x:999:\nnotgpio:x:986:\n");
  const Finding finding = only_trouble(check_groups(machine));
  EXPECT_EQ(finding.what, "missing: gpio; their devices stay root's");
  EXPECT_THAT(finding.fix, HasSubstr("cp systemd/dtactd.sysusers"));
  // The package installs it here.
  machine.file("/usr/lib/sysusers.d/dtactd.conf");
  EXPECT_EQ(only_trouble(check_groups(machine)).fix, "sudo systemd-sysusers");
  machine.file("/etc/group", "gpio:x:986:\nvideo:x:44:anna\nspi:x:999:\n");
  EXPECT_TRUE(all_good(check_groups(machine)));
}

TEST(DoctorRealtime, LimitsOfAnUnprivilegedUser) {
  FakeMachine machine;
  EXPECT_TRUE(all_good(check_realtime(machine)));
  machine.rtprio = 0;
  EXPECT_THAT(only_trouble(check_realtime(machine)).fix, HasSubstr("echo 'anna - rtprio 90'"));
  machine.rtprio = 90;
  machine.memlock = 8U << 20U;
  EXPECT_THAT(only_trouble(check_realtime(machine)).what, HasSubstr("8192 kB"));
  EXPECT_EQ(only_trouble(check_realtime(machine)).verdict, Verdict::wrong);
  machine.root = true;
  EXPECT_TRUE(all_good(check_realtime(machine)));
}

// The unit has LimitRTPRIO= and LimitMEMLOCK=.
TEST(DoctorRealtime, AUsersLimitsAreNotTheServices) {
  FakeMachine machine;
  machine.file("/usr/lib/systemd/system/dtactd.service");
  machine.rtprio = 0;
  EXPECT_EQ(only_trouble(check_realtime(machine)).verdict, Verdict::note);
  machine.rtprio = 90;
  machine.memlock = 8U << 20U;
  EXPECT_EQ(only_trouble(check_realtime(machine)).verdict, Verdict::note);
  machine.root = true;
  EXPECT_EQ(check_realtime(machine).at(0).what, "dtactd.service sets its own limits");
}

TEST(DoctorRealtime, TheShareOfAllRealTimeThreads) {
  FakeMachine machine;
  EXPECT_THAT(check_realtime_share(machine), IsEmpty());
  const auto set = [&](const char* runtime) {
    machine.file("/proc/sys/kernel/sched_rt_period_us", "1000000\n");
    machine.file("/proc/sys/kernel/sched_rt_runtime_us", runtime);
  };
  for (const char* good : {"950000\n", "-1\n"}) {
    set(good);
    EXPECT_TRUE(all_good(check_realtime_share(machine))) << good;
  }
  set("500000\n");
  EXPECT_EQ(only_trouble(check_realtime_share(machine)).verdict, Verdict::note);
  set("0\n");
  const Finding finding = only_trouble(check_realtime_share(machine));
  EXPECT_EQ(finding.verdict, Verdict::wrong);
  EXPECT_THAT(finding.what, HasSubstr("sched_rt_runtime_us = 0 of 1000000"));
  EXPECT_THAT(finding.fix, HasSubstr("sudo sysctl"));
}

TEST(DoctorMemory, TooLittleIsNoted) {
  FakeMachine machine;
  machine.file("/proc/meminfo",
               "MemTotal:  4000000 kB\nMemFree: 20000 kB\nMemAvailable: 131072 kB\n");
  EXPECT_TRUE(all_good(check_memory(machine)));
  machine.file("/proc/meminfo", "MemTotal:  4000000 kB\nMemAvailable: 131071 kB\n");
  const Finding finding = only_trouble(check_memory(machine));
  EXPECT_EQ(finding.what, "127 MiB are available: too few for a daemon that locks its memory");
  EXPECT_THAT(finding.fix, HasSubstr("ps -eo rss"));
}

TEST(DoctorClock, AQuickSourceIsGood) {
  for (const std::string name : {"tsc", "arch_sys_counter", "kvm-clock"}) {
    FakeMachine machine;
    machine.file("/sys/devices/system/clocksource/clocksource0/current_clocksource", name + "\n");
    EXPECT_TRUE(all_good(check_clock_source(machine))) << name;
  }
}

TEST(DoctorClock, ASlowSourceIsWrongWhenAQuickOneIsThere) {
  FakeMachine machine;
  const std::string folder = "/sys/devices/system/clocksource/clocksource0/";
  machine.file(folder + "current_clocksource", "hpet\n");
  machine.file(folder + "available_clocksource", "hpet acpi_pm \n");
  EXPECT_EQ(only_trouble(check_clock_source(machine)).verdict, Verdict::note);
  machine.file(folder + "available_clocksource", "hpet tsc acpi_pm \n");
  const Finding finding = only_trouble(check_clock_source(machine));
  EXPECT_EQ(finding.verdict, Verdict::wrong);
  EXPECT_THAT(finding.fix, HasSubstr("echo tsc | sudo tee"));
}

TEST(DoctorClock, NoSourceFileIsANote) {
  const FakeMachine machine;
  EXPECT_EQ(only_trouble(check_clock_source(machine)).verdict, Verdict::note);
}

TEST(DoctorGovernor, AnyCpuThatIsNotAtFullClockIsNoted) {
  FakeMachine machine;
  EXPECT_TRUE(all_good(check_governor(machine)));
  machine.file("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance\n");
  EXPECT_TRUE(all_good(check_governor(machine)));
  machine.file("/sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "ondemand\n");
  const Finding finding = only_trouble(check_governor(machine));
  EXPECT_EQ(finding.verdict, Verdict::note);
  EXPECT_THAT(finding.what, HasSubstr("ondemand"));
}

}  // namespace
}  // namespace dtact::app::test
