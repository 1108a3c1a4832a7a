// A scene file of the simulated sensor.
#include "hal/sim/scene.hpp"

#include <stdexcept>

#include "tests/fuzz/fuzz.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace dtact;
  try {
    (void)hal::sim::parse_scene({reinterpret_cast<const char*>(data), size}, "seed",
                                "/nonexistent");
  } catch (const std::runtime_error& e) {
    fuzz::require(*e.what() != 0, "an error says something");
  }
  return 0;
}
