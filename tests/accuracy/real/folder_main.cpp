// evaluate_folder FOLDER [PAGE]: measures the lens on a folder of a sensor's images, calibrates
// through it and judges both; writes a page of pictures.
#include <fmt/format.h>

#include <exception>

#include "tests/accuracy/real/folder_evaluation.hpp"

int main(int argc, char** argv) try {
  using namespace dtact;
  if (argc < 2 || argc > 3) {
    fmt::print(stderr, "usage: evaluate_folder FOLDER [PAGE]\n");
    return 2;
  }
  constexpr double kBallRadiusMm = 4;
  const std::filesystem::path folder = std::filesystem::weakly_canonical(argv[1]);
  const ctl::FolderEvaluation e = ctl::evaluate_folder(folder, {}, kBallRadiusMm);
  for (const std::string& line : ctl::lines_of(e)) fmt::print("{}\n", line);
  if (argc == 3) ctl::write_page(e, folder.filename().string(), argv[2]);
  return 0;
} catch (const std::exception& error) {
  fmt::print(stderr, "evaluate_folder: {}\n", error.what());
  return 1;
}
