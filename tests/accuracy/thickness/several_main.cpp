// The LUT from several presses on gels of 1.5 to 3 mm, an uneven one, and other lights.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <thread>
#include <vector>

#include "hal/base/atomic_file.hpp"
#include "tests/accuracy/thickness/several.hpp"

namespace {

using dtact::thickness::SeveralPresses;
using dtact::thickness::Specimen;

std::vector<SeveralPresses> run_all(const std::vector<Specimen>& specimens, int first, int seeds,
                                    int threads) {
  std::vector<SeveralPresses> results(specimens.size() * static_cast<std::size_t>(seeds));
  std::vector<std::exception_ptr> failures(results.size());
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t i = next++; i < results.size(); i = next++) {
      try {
        const std::size_t specimen = i / static_cast<std::size_t>(seeds);
        const auto seed = static_cast<std::uint64_t>(first) + i % static_cast<std::size_t>(seeds);
        results[i] = dtact::thickness::measure_several(specimens[specimen], seed);
        fmt::print(stderr, "{} of {}\n", i + 1, results.size());
      } catch (...) {
        failures[i] = std::current_exception();
      }
    }
  };
  {
    std::vector<std::jthread> workers;
    workers.reserve(static_cast<std::size_t>(threads));
    for (int i = 0; i < threads; ++i) workers.emplace_back(work);
  }
  for (const std::exception_ptr& failure : failures) {
    if (failure) std::rethrow_exception(failure);
  }
  return results;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    CLI::App app("The LUT from several presses, by the gel");
    int first = 11;
    int seeds = 3;
    int threads = 2;
    std::filesystem::path out;
    app.add_option("--first-seed", first, "Of the repetitions");
    app.add_option("--seeds", seeds, "Repetitions")->check(CLI::Range(1, 1000));
    app.add_option("--threads", threads, "Repetitions at a time")->check(CLI::Range(1, 64));
    app.add_option("--out", out, "Folder of several.md; without it, only printed");
    CLI11_PARSE(app, argc, argv);
    const std::vector<Specimen> specimens = {
        {.thickness_mm = 1.5}, {.thickness_mm = 2.0}, {.thickness_mm = 2.5}, {.thickness_mm = 3.0},
        {.configuration = 4},  {.configuration = 5},  {.taper_x = 0.005},    {.taper_x = 0.01}};
    const auto results = run_all(specimens, first, seeds, threads);
    const std::string markdown = dtact::thickness::to_markdown(results);
    fmt::print("{}", markdown);
    if (!out.empty()) {
      dtact::base::write_file_atomically(out / "several.md", markdown);
    }
    return 0;
  } catch (const std::exception& e) {
    fmt::print(stderr, "several_presses: {}\n", e.what());
    return 1;
  }
}
