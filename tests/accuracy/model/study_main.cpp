// Prints the study, or writes its table.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <iterator>
#include <ranges>
#include <string>
#include <vector>

#include "hal/base/atomic_file.hpp"
#include "tests/accuracy/model/study.hpp"

namespace {

using dtact::model_study::Result;

void print(const std::string& name, std::uint64_t seed, const Result& r) {
  fmt::print("{:8} seed {} ({:.1f} s): sphere alone {:.4f} ours {:.4f}", name, seed, r.seconds,
             r.free_mm, r.ours_mm);
  if (r.fit) {
    const auto& gel = r.fit->gel;
    fmt::print(
        "  model {:.4f} sharpened {:.4f} {:.4f} bias {:+.4f} stated {:.4f} | residual {:.3f} "
        "levels, {:.3f} mm deep "
        "(true {:.3f}), gel {:.2f}, widths {:.2f} {:.2f} weight {:.2f}, slopes",
        r.model_mm, r.sharpened_mm[0], r.sharpened_mm[1], r.bias_mm, r.stated_mm,
        r.fit->residual * r.light_levels, r.fit->deepest_mm(), r.true_depth_mm, gel.thickness_mm,
        gel.scattering.narrow_mm, gel.scattering.wide_mm, gel.scattering.narrow_weight);
    for (const double slope : gel.response.slopes) {
      fmt::print(" {:.3f}", slope / gel.thickness_mm);
    }
  }
  fmt::print("{}{}\n", r.refused.empty() ? "" : "  ", r.refused);
  std::fflush(stdout);
}

/// "0.013 (0.014)": mean and worst over the seeds.
template <typename Value>
std::string cell(const std::vector<Result>& results, const Value& value) {
  double sum = 0;
  double worst = 0;
  for (const Result& r : results) {
    sum += value(r);
    worst = std::max(worst, value(r));
  }
  return fmt::format("{:.4f} ({:.4f})", sum / static_cast<double>(results.size()), worst);
}

std::string row(const std::string& name, const std::vector<Result>& results) {
  if (std::ranges::any_of(results, [](const Result& r) { return !r.fit; })) {
    return fmt::format("| {} | refused | | | | |\n", name);
  }
  std::string out = fmt::format("| {} | {} | {} | {} |", name,
                                cell(results, [](const Result& r) { return r.free_mm; }),
                                cell(results, [](const Result& r) { return r.ours_mm; }),
                                cell(results, [](const Result& r) { return r.model_mm; }));
  for (std::size_t i = 0; i < std::size(results.front().sharpened_mm); ++i) {
    out +=
        fmt::format(" {} |", cell(results, [i](const Result& r) { return r.sharpened_mm.at(i); }));
  }
  return out + "\n";
}

}  // namespace

int main(int argc, char** argv) {
  try {
    CLI::App app("Calibrations by the model of a ball press, judged on simulated sensors");
    std::vector<std::uint64_t> seeds = {11, 12, 13};
    std::vector<std::size_t> only;
    int presses = 1;
    int tests = 8;
    std::filesystem::path out;
    app.add_option("--seeds", seeds, "Seeds")->delimiter(',');
    app.add_option("--only", only, "Numbers of specimens (default: all)")->delimiter(',');
    app.add_option("--presses", presses, "Presses that calibrate");
    app.add_option("--tests", tests, "Presses that test");
    app.add_option("--out", out, "Folder of study.md; without it, only printed");
    CLI11_PARSE(app, argc, argv);
    std::string table =
        "| sensor | sphere alone | ours | the gel's LUT | sharpened, one step | two steps |\n"
        "| --- | --- | --- | --- | --- | --- |\n";
    const auto all = dtact::model_study::specimens();
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (!only.empty() && std::ranges::find(only, i) == only.end()) continue;
      std::vector<Result> results;
      for (const std::uint64_t seed : seeds) {
        results.push_back(dtact::model_study::measure(all[i], seed, presses, tests));
        print(all[i].name, seed, results.back());
      }
      table += row(all[i].name, results);
    }
    if (!out.empty()) dtact::base::write_file_atomically(out / "study.md", table);
    return 0;
  } catch (const std::exception& e) {
    fmt::print(stderr, "model_study: {}\n", e.what());
    return 1;
  }
}
