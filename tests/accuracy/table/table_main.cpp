// The paper's table in the simulator: every configuration, every method, many seeds.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "hal/base/atomic_file.hpp"
#include "tests/accuracy/table/configuration.hpp"
#include "tests/accuracy/table/table.hpp"

namespace {

using dtact::table::Cell;

std::vector<Cell> run_all(int seeds, int threads, std::size_t columns) {
  std::vector<std::vector<Cell>> trials(static_cast<std::size_t>(seeds));
  std::vector<std::exception_ptr> failures(trials.size());
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t i = next++; i < trials.size(); i = next++) {
      try {
        const auto trial = dtact::table::draw(i + 1);
        trials[i] = dtact::table::run_trial(trial, columns);
        // One row on a sensor that fits no method's model.
        const auto other = dtact::table::run_trial(trial, 1, dtact::table::Law::another);
        trials[i].insert(trials[i].end(), other.begin(), other.end());
        fmt::print(stderr, "seed {} done\n", i + 1);
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
  std::vector<Cell> cells;
  for (std::size_t i = 0; i < trials.size(); ++i) {
    if (failures[i]) std::rethrow_exception(failures[i]);
    cells.insert(cells.end(), trials[i].begin(), trials[i].end());
  }
  return cells;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    CLI::App app("The paper's table, reproduced in the simulator");
    int seeds = 10;
    int threads = 2;
    std::size_t columns = dtact::table::configurations().size();
    std::filesystem::path out;
    app.add_option("--seeds", seeds, "Repetitions")->check(CLI::Range(1, 1000));
    app.add_option("--threads", threads, "Seeds at a time")->check(CLI::Range(1, 64));
    app.add_option("--columns", columns, "Configurations, from the first")
        ->check(CLI::Range(std::size_t{1}, columns));
    app.add_option("--out", out, "Folder of table.csv and table.md; without it, only printed");
    CLI11_PARSE(app, argc, argv);
    const auto cells = run_all(seeds, threads, columns);
    const std::string markdown = dtact::table::to_markdown(cells);
    fmt::print("{}", markdown);
    if (!out.empty()) {
      dtact::base::write_file_atomically(out / "table.csv", dtact::table::to_csv(cells));
      dtact::base::write_file_atomically(out / "table.md", markdown);
    }
    return 0;
  } catch (const std::exception& e) {
    fmt::print(stderr, "paper_table: {}\n", e.what());
    return 1;
  }
}
