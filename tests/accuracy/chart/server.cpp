// Runs one setting on one shot on command, so that a driver can alternate between all of them
// and the Python pipeline.
//   list                  the settings, tab separated: NAME|METHOD|DECIMATION|TILES|SMOOTHING_MM
//   shots                 the shots' names, tab separated
//   use SHOT|NAME         selects both for the next verbs
//   error                 mean absolute error in mm, share of untrusted pixels
//   run COUNT             two unmeasured frames, then COUNT times, nanoseconds of CPU a frame
//   instructions          user instructions a frame, or "none"
//   export FOLDER         writes the Python pipeline's input
#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <fstream>
#include <iostream>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>

#include "tests/accuracy/chart/instructions.hpp"
#include "tests/accuracy/chart/settings.hpp"
#include "tests/bench/cpu_time.hpp"

namespace {

using namespace dtact::chart;
using dtact::bench::thread_ns;
namespace image = dtact::image;

template <typename T>
void write_raw(const std::string& file, const std::vector<T>& values) {
  std::ofstream out(file, std::ios::binary);
  out.write(reinterpret_cast<const char*>(values.data()),
            static_cast<std::streamsize>(values.size() * sizeof(T)));
  if (!out.flush()) throw std::runtime_error("cannot write " + file);
}

/// The published method's LUT for whole grey levels 0 … 255, millimetres.
std::vector<float> published_lut_mm(const std::vector<Setting>& settings) {
  const auto it = std::ranges::find(settings, "published", &Setting::method);
  const dtact::recon::DepthLut& lut = it->model->lut;
  std::vector<float> mm;
  for (int level = 0; level < 256; ++level) {
    const int entry = std::clamp(level * dtact::recon::kEntriesPerLevel - lut.first_q6, 0,
                                 static_cast<int>(lut.um.size()) - 1);
    mm.push_back(static_cast<float>(lut.um[static_cast<std::size_t>(entry)]) / 1000.0F);
  }
  return mm;
}

struct Lab {
  image::Grey16 reference = make_reference();
  std::vector<Shot> shots = make_shots();
  std::vector<Setting> settings = make_settings(reference);
  std::map<int, image::Grey16> references;  // by decode_scale
  std::unique_ptr<Worker> worker;

  const image::Grey16& reference_of(const Setting& setting) {
    auto found = references.find(setting.decode_scale);
    if (found == references.end()) {
      found = references.emplace(setting.decode_scale, reference_for(setting, reference)).first;
    }
    return found->second;
  }
  void use(const std::string& what) {
    const std::size_t bar = what.find('|');
    for (const Shot& shot : shots) {
      if (shot.name != what.substr(0, bar)) continue;
      for (const Setting& setting : settings) {
        if (setting.name != what.substr(bar + 1)) continue;
        worker = std::make_unique<Worker>(setting, reference_of(setting), shot);
        return;
      }
    }
    throw std::runtime_error("no such shot and setting: " + what);
  }
  void export_to(const std::string& folder) const {
    write_raw(folder + "/reference.u16", reference.pixels);
    write_raw(folder + "/list.f32", published_lut_mm(settings));
    for (const Shot& shot : shots) {
      std::vector<std::uint8_t> frames;
      for (const auto& frame : shot.frames) {
        frames.insert(frames.end(), frame.pixels.begin(), frame.pixels.end());
      }
      write_raw(folder + "/" + shot.name + ".u8", frames);
      write_raw(folder + "/" + shot.name + ".truth.f32", shot.truth_mm);
      write_raw(folder + "/" + shot.name + ".judged.u8", shot.judged);
    }
  }
};

std::string answer(Lab& lab, const std::string& verb, const std::string& rest) {
  if (verb == "list") {
    std::string out;
    for (const Setting& s : lab.settings) {
      out += fmt::format("{}|{}|{}|{}|{}\t", s.name, s.method, s.decimation, s.tiles ? 1 : 0,
                         s.smoothing_mm);
    }
    return out;
  }
  if (verb == "shots") {
    std::string out;
    for (const Shot& shot : lab.shots) out += shot.name + '\t';
    return out;
  }
  if (verb == "use") {
    lab.use(rest);
    return "ok";
  }
  if (verb == "export") {
    lab.export_to(rest);
    return "ok";
  }
  if (!lab.worker) throw std::runtime_error("'use SHOT|NAME' comes first");
  if (verb == "error") {
    const Error error = lab.worker->error();
    return fmt::format("{} {}", error.mean_absolute_mm, error.untrusted_share);
  }
  if (verb == "run") {
    lab.worker->once();
    lab.worker->once();
    std::string out;
    for (int i = std::stoi(rest); i > 0; --i) {
      const std::int64_t begin = thread_ns();
      lab.worker->once();
      out += fmt::format("{} ", thread_ns() - begin);
    }
    return out;
  }
  if (verb == "instructions") {
    constexpr int kFrames = 8;  // of a shot
    for (int i = 0; i < kFrames; ++i) lab.worker->once();
    const auto count = count_instructions([&] {
      for (int i = 0; i < kFrames; ++i) lab.worker->once();
    });
    return count ? fmt::format("{}", *count / kFrames) : "none";
  }
  throw std::runtime_error("unknown verb " + verb);
}

}  // namespace

int main() {
  try {
    Lab lab;
    for (std::string line; std::getline(std::cin, line);) {
      const std::size_t space = line.find(' ');
      const std::string rest = space == std::string::npos ? "" : line.substr(space + 1);
      std::cout << answer(lab, line.substr(0, space), rest) << '\n' << std::flush;
    }
  } catch (const std::exception& e) {
    std::cerr << "chart_server: " << e.what() << '\n';
    return 1;
  }
  return 0;
}
