#include "hal/base/rt_thread.hpp"

#include <fmt/format.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <exception>
#include <memory>
#include <system_error>
#include <utility>

namespace dtact::base {
namespace {

void* run_body(void* argument) {
  const std::unique_ptr<std::function<void()>> body(static_cast<std::function<void()>*>(argument));
  (*body)();
  return nullptr;
}

std::string fifo_refused(const std::string& name, int priority, int error) {
  return fmt::format(
      "thread {} runs without SCHED_FIFO priority {} ({}): give the user an rtprio limit "
      "(LimitRTPRIO={} in the unit, or /etc/security/limits.d)",
      name, priority, std::strerror(error), priority);
}

rlimit rttime_limit{};
thread_local volatile std::sig_atomic_t demoted = 0;

/// The kernel sends SIGXCPU to the thread that has run for too long.
void demote(int /*signal*/) {
  const int error = errno;
  const sched_param parameters{.sched_priority = 0};
  // An unprivileged thread may not take RESET_ON_FORK back (sched(7)).
  (void)::sched_setscheduler(0, SCHED_OTHER | SCHED_RESET_ON_FORK, &parameters);
  // The kernel has raised the soft limit, maybe above the hard one, where it warns nobody.
  (void)::setrlimit(RLIMIT_RTTIME, &rttime_limit);
  demoted = 1;
  errno = error;
}

}  // namespace

RtThread::RtThread(const RtSettings& settings, std::function<void()> body) {
  pthread_attr_t attributes;
  ::pthread_attr_init(&attributes);
  ::pthread_attr_setstacksize(&attributes, settings.stack_bytes);
  auto owned = std::make_unique<std::function<void()>>(std::move(body));
  const int error = ::pthread_create(&thread_, &attributes, run_body, owned.get());
  ::pthread_attr_destroy(&attributes);
  if (error != 0) {
    throw std::system_error(error, std::generic_category(),
                            fmt::format("cannot start thread \"{}\"", settings.name));
  }
  (void)owned.release();  // run_body owns it now
  joinable_ = true;

  ::pthread_setname_np(thread_, settings.name.substr(0, 15).c_str());
  if (settings.cpu) {
    cpu_set_t cpus;
    CPU_ZERO(&cpus);
    CPU_SET(static_cast<std::size_t>(*settings.cpu), &cpus);
    if (const int e = ::pthread_setaffinity_np(thread_, sizeof cpus, &cpus); e != 0) {
      refused_.push_back(fmt::format(
          "thread {} is not pinned to CPU {} ({}): choose a CPU this machine and the unit's "
          "AllowedCPUs= have",
          settings.name, *settings.cpu, std::strerror(e)));
    } else {
      cpu_ = settings.cpu;
    }
  }
  if (settings.fifo_priority > 0) {
    const sched_param parameters{.sched_priority = settings.fifo_priority};
    if (const int e = ::pthread_setschedparam(thread_, SCHED_FIFO, &parameters); e != 0) {
      refused_.push_back(fifo_refused(settings.name, settings.fifo_priority, e));
    }
  }
}

RtThread::RtThread(RtThread&& other) noexcept
    : thread_(other.thread_),
      joinable_(std::exchange(other.joinable_, false)),
      cpu_(other.cpu_),
      refused_(std::move(other.refused_)) {}

RtThread& RtThread::operator=(RtThread&& other) noexcept {
  if (this != &other) {
    join();
    thread_ = other.thread_;
    joinable_ = std::exchange(other.joinable_, false);
    cpu_ = other.cpu_;
    refused_ = std::move(other.refused_);
  }
  return *this;
}

void RtThread::join() noexcept {
  if (std::exchange(joinable_, false)) ::pthread_join(thread_, nullptr);
}

void run_unpinned(const cpu_set_t& cpus, const std::function<void()>& body) {
  std::exception_ptr thrown;
  std::function<void()> guarded = [&] {
    try {
      body();
    } catch (...) {
      thrown = std::current_exception();
    }
  };
  pthread_attr_t attributes;
  ::pthread_attr_init(&attributes);
  ::pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
  ::pthread_attr_setschedpolicy(&attributes, SCHED_OTHER);
  // Set although 0 is the default: glibc takes an unset priority from the calling thread,
  // and refuses SCHED_OTHER with that of a real-time thread.
  const sched_param parameters{.sched_priority = 0};
  ::pthread_attr_setschedparam(&attributes, &parameters);
  ::pthread_attr_setaffinity_np(&attributes, sizeof cpus, &cpus);
  pthread_t thread{};
  const int error = ::pthread_create(
      &thread, &attributes,
      [](void* argument) -> void* {
        (*static_cast<std::function<void()>*>(argument))();
        return nullptr;
      },
      &guarded);
  ::pthread_attr_destroy(&attributes);
  if (error != 0) {
    throw std::system_error(error, std::generic_category(), "cannot start a thread");
  }
  ::pthread_join(thread, nullptr);
  if (thrown) std::rethrow_exception(thrown);
}

cpu_set_t allowed_cpus() noexcept {
  cpu_set_t cpus;
  CPU_ZERO(&cpus);
  (void)::sched_getaffinity(0, sizeof cpus, &cpus);
  return cpus;
}

std::optional<std::string> make_fifo(const std::string& name, int priority) {
  const sched_param parameters{.sched_priority = priority};
  // RESET_ON_FORK: without it, threads that libraries start later would be real-time, too.
  if (::sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &parameters) == 0) {
    return std::nullopt;
  }
  return fifo_refused(name, priority, errno);
}

void demote_at_rttime_limit() noexcept {
  ::getrlimit(RLIMIT_RTTIME, &rttime_limit);
  struct sigaction action{};
  action.sa_handler = demote;
  action.sa_flags = SA_RESTART;
  ::sigaction(SIGXCPU, &action, nullptr);
}

bool was_demoted() noexcept { return demoted != 0; }

std::string demoted_sentence(const std::string& name) {
  return fmt::format(
      "thread {} had more work than time and lost its real-time priority: give it less, a restart "
      "gives the priority back",
      name);
}

std::optional<std::string> lock_memory() {
  // ONFAULT: pages are locked at first access, so unused reserve costs nothing.
  if (::mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0) return std::nullopt;
  const int error = errno;
  return fmt::format(
      "memory is not locked ({}): raise the memlock limit (LimitMEMLOCK=infinity in the unit, or "
      "/etc/security/limits.d)",
      std::strerror(error));
}

}  // namespace dtact::base
