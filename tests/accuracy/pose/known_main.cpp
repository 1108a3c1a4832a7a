// The study's objects, found by their shape and followed: a table, and a line for each sequence.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "tests/accuracy/pose/known_object.hpp"
#include "tests/accuracy/pose/things.hpp"

namespace dtact::pose {
namespace {

/// NaN of nothing.
double part_of(std::vector<double> values, double part) {
  if (values.empty()) return NAN;
  std::ranges::sort(values);
  return values[static_cast<std::size_t>(part * static_cast<double>(values.size() - 1))];
}

/// 30 frames a second.
constexpr int kSteps = 60;

struct Row {
  std::vector<double> um, degrees, search_ms, frame_us;
  int sequences = 0;
  int found = 0;   ///< Where it is, within 0.5 mm and 10°.
  int others = 0;  ///< On another part of it that explains the contact as well.
  int kept = 0;    ///< Found, and in every frame.
};

void study(const std::string& only) {
  fmt::print("| | found / elsewhere / not | kept | median error | 95 % | alternatives |\n");
  fmt::print("| --- | --- | --- | --- | --- | --- |\n");
  Row all;
  for (const Thing& thing : kThings) {
    if (!only.empty() && only != thing.name) continue;
    Row row;
    std::uint32_t alternatives = 0;
    for (const Way& way : {kSlide, kTwist, kRoll, kDeeper}) {
      const KnownResult result = follow_known(thing.lines, way, kSteps);
      const bool placed = !result.um.empty();
      const bool here = placed && result.first_um < 500 && result.first_deg < 10;
      fmt::print(
          stderr,
          "{} {}: first {:.0f} um {:.2f} deg, {} alternatives, {} hidden; {:.0f} um {:.2f} deg, "
          "worst {:.0f} um {:.2f} deg; {} unplaced, {} elsewhere of {}; search {:.0f} ms, frame "
          "{:.0f} us\n",
          thing.name, way.name, result.first_um, result.first_deg, result.alternatives,
          result.hidden, part_of(result.um, 0.5), part_of(result.degrees, 0.5),
          part_of(result.um, 1), part_of(result.degrees, 1), result.unplaced, result.others,
          result.frames, result.search_ms, part_of(result.frame_us, 0.5));
      for (Row* one : {&row, &all}) {
        ++one->sequences;
        one->found += here ? 1 : 0;
        one->others += placed && !here ? 1 : 0;
        one->kept += here && result.unplaced == 0 && result.others == 0 ? 1 : 0;
        one->search_ms.push_back(result.search_ms);
        one->frame_us.insert(one->frame_us.end(), result.frame_us.begin(), result.frame_us.end());
        if (!here) continue;
        one->um.insert(one->um.end(), result.um.begin(), result.um.end());
        one->degrees.insert(one->degrees.end(), result.degrees.begin(), result.degrees.end());
      }
      alternatives = std::max(alternatives, result.alternatives);
    }
    const auto print = [](const std::string& name, const Row& one, const std::string& last) {
      fmt::print("| {} | {} / {} / {} | {} | {:.0f} µm, {:.2f}° | {:.0f} µm, {:.2f}° | {} |\n",
                 name, one.found, one.others, one.sequences - one.found - one.others, one.kept,
                 part_of(one.um, 0.5), part_of(one.degrees, 0.5), part_of(one.um, 0.95),
                 part_of(one.degrees, 0.95), last);
    };
    print(thing.name, row, std::to_string(alternatives));
    if (&thing == &kThings.back()) print("all", all, "");
    std::fflush(stdout);
  }
  fmt::print(
      "\nA search takes {:.0f} ms (median, at most {:.0f}), a frame {:.2f} ms (95 %: {:.2f}).\n",
      part_of(all.search_ms, 0.5), part_of(all.search_ms, 1), 1e-3 * part_of(all.frame_us, 0.5),
      1e-3 * part_of(all.frame_us, 0.95));
}

}  // namespace
}  // namespace dtact::pose

int main(int argc, char** argv) {
  try {
    CLI::App app("Known objects on the simulated layer, how they are found and followed");
    std::string only;
    app.add_option("--only", only, "One object");
    CLI11_PARSE(app, argc, argv);
    dtact::pose::study(only);
    return 0;
  } catch (const std::exception& e) {
    fmt::print(stderr, "pose_known_objects: {}\n", e.what());
    return 1;
  }
}
