#include "tests/accuracy/table/another_law.hpp"

namespace dtact::table {

hal::sim::Scene another_law() {
  return hal::sim::load_scene(DTACT_SOURCE_DIR "/tests/accuracy/table/another_law.toml");
}

}  // namespace dtact::table
