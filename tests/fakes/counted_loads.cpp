#include "tests/fakes/counted_loads.hpp"

#include <signal.h>
#include <sys/mman.h>
#include <ucontext.h>

#include <new>

namespace dtact::fakes {
namespace {

constexpr std::size_t kSize = 65536;

#if defined(__x86_64__)
constexpr long long kTrapFlag = 0x100;  // bit of RFLAGS: a trap after the next instruction

std::uint8_t* memory = nullptr;
volatile std::size_t loads = 0;

// A load has hit the unreadable memory: it is allowed, with a trap after it.
void on_fault(int /*signal*/, siginfo_t* info, void* context) {
  auto* at = static_cast<std::uint8_t*>(info->si_addr);
  if (at < memory || at >= memory + kSize) {
    ::signal(SIGSEGV, SIG_DFL);  // another fault: it repeats on return
    return;
  }
  loads = loads + 1;
  ::mprotect(memory, kSize, PROT_READ);
  static_cast<ucontext_t*>(context)->uc_mcontext.gregs[REG_EFL] |= kTrapFlag;
}

void on_trap(int /*signal*/, siginfo_t* /*info*/, void* context) {
  ::mprotect(memory, kSize, PROT_NONE);
  static_cast<ucontext_t*>(context)->uc_mcontext.gregs[REG_EFL] &= ~kTrapFlag;
}
#endif

}  // namespace

CountedLoads::CountedLoads(std::size_t bytes) {
  void* at = ::mmap(nullptr, kSize, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (at == MAP_FAILED || bytes > kSize) throw std::bad_alloc();
  bytes_ = {static_cast<std::uint8_t*>(at), bytes};
}

CountedLoads::~CountedLoads() { ::munmap(bytes_.data(), kSize); }

std::optional<std::size_t> CountedLoads::count(const std::function<void()>& read) const {
#if defined(__x86_64__)
  memory = bytes_.data();
  loads = 0;
  struct sigaction fault{};
  struct sigaction trap{};
  fault.sa_sigaction = on_fault;
  trap.sa_sigaction = on_trap;
  fault.sa_flags = trap.sa_flags = SA_SIGINFO;
  struct sigaction old_fault{};
  struct sigaction old_trap{};
  ::sigaction(SIGSEGV, &fault, &old_fault);
  ::sigaction(SIGTRAP, &trap, &old_trap);
  ::mprotect(memory, kSize, PROT_NONE);
  read();
  ::mprotect(memory, kSize, PROT_READ | PROT_WRITE);
  ::sigaction(SIGSEGV, &old_fault, nullptr);
  ::sigaction(SIGTRAP, &old_trap, nullptr);
  return loads;
#else
  (void)read;
  return std::nullopt;
#endif
}

}  // namespace dtact::fakes
