// recognition_outputs: what dtact-perceive's network says of simulated presses, for judge.py.
#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <fstream>

#include "clients/perceive/recognition/recogniser.hpp"

namespace {

// FOLDER/maps.i16 to FOLDER/outputs.f32: for each map the probabilities and the features.
void write_outputs(const std::filesystem::path& folder) {
  using dtact::perceive::TouchMap;
  dtact::perceive::Network network;
  std::ifstream maps(folder / "maps.i16", std::ios::binary);
  std::ofstream out(folder / "outputs.f32", std::ios::binary);
  out.exceptions(std::ios::failbit | std::ios::badbit);
  std::array<std::int16_t, std::size_t{TouchMap::kSide} * TouchMap::kSide> um{};
  while (maps.read(reinterpret_cast<char*>(um.data()), sizeof(um))) {
    TouchMap map;
    for (std::size_t i = 0; i < um.size(); ++i) map.mm[i] = 1e-3F * um[i];
    const auto output = network.run(map);
    const std::vector<float> p(output.probabilities.begin(), output.probabilities.end());
    for (const auto* part : {&p, &output.features}) {
      out.write(reinterpret_cast<const char*>(part->data()),
                static_cast<std::streamsize>(part->size() * sizeof(float)));
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  try {
    for (int i = 1; i < argc; ++i) write_outputs(argv[i]);
    return 0;
  } catch (const std::exception& error) {
    fmt::print(stderr, "recognition_outputs: {}\n", error.what());
    return 1;
  }
}
