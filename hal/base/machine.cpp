#include "hal/base/machine.hpp"

#include <malloc.h>

#include <algorithm>
#include <fstream>
#include <system_error>

namespace dtact::base {

Heap heap() noexcept {
  const auto info = ::mallinfo2();
  return {.used = info.uordblks + info.hblkhd, .free = info.fordblks, .mapped = info.hblkhd};
}

namespace fs = std::filesystem;

std::vector<Temperature> temperatures(const fs::path& folder) {
  std::vector<Temperature> all;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    Temperature one{entry->path().filename().string(), {}, 0};
    if (!one.zone.starts_with("thermal_zone")) continue;
    std::getline(std::ifstream(entry->path() / "type"), one.type);
    long millidegrees = 0;
    if (!(std::ifstream(entry->path() / "temp") >> millidegrees)) continue;
    one.celsius = static_cast<double>(millidegrees) / 1000;
    all.push_back(std::move(one));
  }
  std::ranges::sort(all, {}, &Temperature::zone);
  return all;
}

}  // namespace dtact::base
