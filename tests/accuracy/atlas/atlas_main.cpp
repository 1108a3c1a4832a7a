// The stability atlas: every row, every method, through the daemon's capture loop.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include "hal/base/atomic_file.hpp"
#include "tests/accuracy/atlas/methods.hpp"
#include "tests/accuracy/atlas/rows.hpp"

namespace {

namespace atlas = dtact::atlas;

struct Job {
  const atlas::Row* row;
  double value;
  const atlas::Method* method;
  std::string line;
  std::exception_ptr failure;
};

void work(Job& job) {
  try {
    const atlas::Outcome o = atlas::run(*job.method, job.row->script(job.value));
    job.line = fmt::format(
        "{},{},\"{}\",\"{}\",\"{}\",\"{}\",{},{:.5f},{:.5f},{:.5f},{:.5f},{:.3f},{:.3f},\"{}\"\n",
        job.row->group, job.row->id, job.row->title, job.row->unit, job.row->undecidable,
        job.method->name, job.value, o.inside_mm, o.outside_mm, o.along_mm, o.stated_mm, o.withheld,
        o.flagged, atlas::health_flags_of(o));
  } catch (...) {
    job.failure = std::current_exception();
  }
}

std::string all(std::vector<Job>& jobs, int threads) {
  std::atomic<std::size_t> next{0};
  {
    std::vector<std::jthread> workers;
    workers.reserve(static_cast<std::size_t>(threads));
    for (int i = 0; i < threads; ++i) {
      workers.emplace_back([&] {
        for (std::size_t j = next++; j < jobs.size(); j = next++) work(jobs[j]);
      });
    }
  }
  std::string csv =
      "group,row,title,unit,undecidable,method,value,inside_mm,outside_mm,along_mm,stated_mm,"
      "withheld,"
      "flagged,"
      "health_flags\n";
  for (const Job& job : jobs) {
    if (job.failure) std::rethrow_exception(job.failure);
    csv += job.line;
  }
  return csv;
}

/// A line like the others: the value is the number of frames, the error the share flagged falsely.
std::string false_flags() {
  int frames = 0;
  double flagged = 0;
  std::string health_flags;
  const auto several =
      std::ranges::find(atlas::methods(), "sphere alone, many presses", &atlas::Method::name);
  for (const atlas::Script& script : atlas::clean_scripts()) {
    const atlas::Outcome o = atlas::run(*several, script);
    frames += o.frames;
    flagged += o.flagged * o.frames;
    health_flags += atlas::health_flags_of(o);
  }
  return fmt::format("clean,clean,,,,,{},{:.5f},,,,,,\"{}\"\n", frames, flagged / frames,
                     health_flags);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    CLI::App app("Where methods fail: the stability atlas");
    int threads = 2;
    std::string only;
    std::filesystem::path out;
    app.add_option("--threads", threads, "Runs at a time")->check(CLI::Range(1, 64));
    app.add_option("--row", only, "One row instead of all");
    app.add_option("--out", out, "Folder of atlas.csv; without it, only printed");
    CLI11_PARSE(app, argc, argv);
    const auto rows = atlas::rows();
    std::vector<Job> jobs;
    for (const atlas::Method& method : atlas::methods()) {
      for (const atlas::Row& row : rows) {
        if (!only.empty() && row.id != only) continue;
        for (const double value : row.values) jobs.push_back({&row, value, &method, {}, {}});
      }
    }
    std::string csv = all(jobs, threads);
    if (only.empty()) csv += false_flags();
    fmt::print("{}", csv);
    if (!out.empty()) dtact::base::write_file_atomically(out / "atlas.csv", csv);
    return 0;
  } catch (const std::exception& e) {
    fmt::print(stderr, "stability_atlas: {}\n", e.what());
    return 1;
  }
}
