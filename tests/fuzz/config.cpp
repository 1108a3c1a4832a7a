// A configuration file and, each after a zero byte, values of --set. An accepted configuration can
// be printed, and the printed one means the same.
#include "daemon/app/config.hpp"

#include <sstream>
#include <stdexcept>

#include "tests/fuzz/fuzz.hpp"

namespace dtact::fuzz {
namespace {

/// The effective values without their origins.
std::vector<std::string> values_of(const app::LoadedConfig& loaded) {
  std::ostringstream out;
  app::print_config(loaded, out);
  std::vector<std::string> values;
  std::istringstream lines(out.str());
  for (std::string line; std::getline(lines, line);) {
    values.push_back(line.substr(0, line.rfind(" # ")));
  }
  return values;
}

void use(const app::LoadedConfig& loaded) {
  std::ostringstream printed;
  app::print_config(loaded, printed);
  const MemoryFile file(printed.str());
  require(values_of(app::load_config(file.path(), {})) == values_of(loaded),
          "a printed configuration means the same");
}

}  // namespace
}  // namespace dtact::fuzz

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace dtact;
  auto parts =
      fuzz::split({reinterpret_cast<const char*>(data), size}, std::string_view("\0", 1), 8);
  const fuzz::MemoryFile file(parts.front());
  parts.erase(parts.begin());
  try {
    fuzz::use(app::load_config(file.path(), parts));
  } catch (const std::runtime_error& e) {
    fuzz::require(*e.what() != 0, "an error says something");
  }
  return 0;
}
