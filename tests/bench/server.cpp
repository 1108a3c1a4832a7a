// Times one case at a time on request, so that a driver can alternate between cases and processes.
//   list               NAME=SHARE of the map that is computed, one line
//   verify NAME        "ok" or the error
//   run NAME COUNT     two unmeasured runs, then COUNT times, nanoseconds of CPU, one line
//   once NAME COUNT    exactly COUNT runs, for counting instructions
//   target             the instruction set the kernels run with
//   export FOLDER      the inputs, for the Python pipeline
#include <algorithm>
#include <cstdint>
#include <exception>
#include <iostream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>

#include "daemon/recon/vector_kernels.hpp"
#include "tests/bench/cases.hpp"
#include "tests/bench/cpu_time.hpp"

namespace {

using dtact::bench::Case;
using dtact::bench::thread_ns;

/// Made at the first request.
const Case& find(const std::string& name) {
  static std::map<std::string, Case> cases;
  const auto known = cases.find(name);
  return known != cases.end() ? known->second
                              : cases.emplace(name, dtact::bench::make_case(name)).first->second;
}

void time(const Case& c, int count) {
  // Reading the clock takes about a fifth of a microsecond: short cases are timed many at a time.
  constexpr std::int64_t kShortest_ns = 50'000;
  c.once();
  const std::int64_t warm = thread_ns();
  c.once();
  const std::int64_t once_ns = std::max<std::int64_t>(1, thread_ns() - warm);
  const std::int64_t batch = std::max<std::int64_t>(1, kShortest_ns / once_ns);
  for (int i = 0; i < count; ++i) {
    const std::int64_t begin = thread_ns();
    for (std::int64_t k = 0; k < batch; ++k) c.once();
    std::cout << static_cast<double>(thread_ns() - begin) / static_cast<double>(batch) << ' ';
  }
}

}  // namespace

int main() {
  try {
    for (std::string line; std::getline(std::cin, line);) {
      std::istringstream words(line);
      std::string verb;
      std::string name;
      int count = 1;
      words >> verb >> name >> count;
      if (verb == "list") {
        for (const std::string& c : dtact::bench::case_names()) {
          std::cout << c << '=' << find(c).share << ' ';
        }
      } else if (verb == "verify") {
        const std::string wrong = find(name).verify();
        std::cout << (wrong.empty() ? "ok" : wrong);
      } else if (verb == "run") {
        time(find(name), count);
      } else if (verb == "once") {
        for (int i = 0; i < count; ++i) find(name).once();
      } else if (verb == "target") {
        std::cout << dtact::recon::vec::target_name();
      } else if (verb == "export") {
        dtact::bench::export_inputs(name);
        std::cout << "ok";
      }
      std::cout << '\n' << std::flush;
    }
  } catch (const std::exception& e) {
    std::cerr << "bench_server: " << e.what() << '\n';
    return 1;
  }
  return 0;
}
