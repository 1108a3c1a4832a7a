// Prints the study.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <ranges>

#include "tests/accuracy/model/study.hpp"

int main(int argc, char** argv) {
  CLI::App app("Calibrations by the model of a ball press, judged on simulated sensors");
  std::vector<std::uint64_t> seeds = {1};
  std::vector<std::size_t> only;
  int presses = 1;
  int tests = 6;
  app.add_option("--seeds", seeds, "Seeds")->delimiter(',');
  app.add_option("--only", only, "Numbers of specimens (default: all)")->delimiter(',');
  app.add_option("--presses", presses, "Presses that calibrate");
  app.add_option("--tests", tests, "Presses that test");
  CLI11_PARSE(app, argc, argv);
  const auto all = dtact::model_study::specimens();
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (!only.empty() && std::ranges::find(only, i) == only.end()) continue;
    for (const std::uint64_t seed : seeds) {
      const auto r = dtact::model_study::measure(all[i], seed, presses, tests);
      fmt::print("{:8} seed {} ({:.1f} s): free {:.4f} ours {:.4f}", all[i].name, seed, r.seconds,
                 r.free_mm, r.ours_mm);
      if (r.fit) {
        const auto& layer = r.fit->layer;
        fmt::print(
            "  model {:.4f} sharpened {:.4f} {:.4f} bias {:+.4f} stated {:.4f} | residual {:.3f} "
            "levels, {:.3f} mm deep "
            "(true {:.3f}), layer {:.2f}, widths {:.2f} {:.2f} weight {:.2f}, slopes",
            r.model_mm, r.sharpened_mm[0], r.sharpened_mm[1], r.bias_mm, r.stated_mm,
            r.fit->residual * r.light_levels, r.fit->deepest_mm(), r.true_depth_mm,
            layer.thickness_mm, layer.scattering.narrow_mm, layer.scattering.wide_mm,
            layer.scattering.narrow_weight);
        for (const double slope : layer.response.slopes) {
          fmt::print(" {:.3f}", slope / layer.thickness_mm);
        }
      }
      fmt::print("{}{}\n", r.refused.empty() ? "" : "  ", r.refused);
      std::fflush(stdout);
    }
  }
  return 0;
}
