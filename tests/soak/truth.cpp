// soak_truth SCENE FILE:FRAME...: the simulator's own indentation at some frames of a scene,
// independent of the code under test. Each FILE gets the camera's pixels row by row: float32
// millimetres of all (positive = pressed), then a byte of each, 255 in contact.
// Prints the image's width and height.
#include "hal/sim/truth.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "hal/base/atomic_file.hpp"

namespace {

namespace sim = dtact::hal::sim;

void write(const sim::Truth& truth, const std::string& argument) {
  const std::size_t colon = argument.rfind(':');
  std::uint64_t frame = 0;
  const char* const end = argument.data() + argument.size();
  if (colon == std::string::npos ||
      std::from_chars(argument.data() + colon + 1, end, frame).ptr != end) {
    throw std::runtime_error(fmt::format("{}: must be FILE:FRAME, as in ball.truth:240", argument));
  }
  std::vector<float> indentation;
  std::vector<std::uint8_t> contact;
  truth.indentation_mm(frame, indentation);
  truth.contact(frame, contact);
  std::string bytes(reinterpret_cast<const char*>(indentation.data()),
                    indentation.size() * sizeof(float));
  bytes.append(reinterpret_cast<const char*>(contact.data()), contact.size());
  dtact::base::write_file_atomically(argument.substr(0, colon), bytes);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    if (argc < 3) throw std::runtime_error("usage: soak_truth SCENE FILE:FRAME...");
    const sim::Truth truth(sim::load_scene(argv[1]));
    for (int i = 2; i < argc; ++i) write(truth, argv[i]);
    fmt::print("{} {}\n", truth.scene().camera.width, truth.scene().camera.height);
    return 0;
  } catch (const std::exception& problem) {
    fmt::print(stderr, "soak_truth: {}\n", problem.what());
    return 1;
  }
}
