#pragma once

#include <CLI/CLI.hpp>

namespace dtact::ctl {

// Each adds a command to `app` whose callback does the work and prints its result to standard
// output; it throws std::runtime_error or std::invalid_argument with a message on failure.

/// depth --reference R.png --ball B.png --radius-mm 4.0 --mm-per-px S -o cal/
void add_calibrate(CLI::App& app);
/// lens --board-reference R.png --board B.png -o lens.toml
void add_calibrate_lens(CLI::App& app);
/// apply --calibration cal/ --reference R.png --frame F.png -o depth.{npy,png,ply}
void add_apply(CLI::App& app);
/// evaluate --calibration cal/ --reference R.png --ball B.png --radius-mm 4.0.
/// `json` is read when the command runs; then it prints one JSON object instead of sentences.
void add_evaluate(CLI::App& app, const bool& json);

/// import DIR -o cal/
void add_import(CLI::App& app);

/// Adds all of the above.
inline void add_offline_commands(CLI::App& app, const bool& json) {
  add_calibrate(app);
  add_calibrate_lens(app);
  add_apply(app);
  add_evaluate(app, json);
  add_import(app);
}

}  // namespace dtact::ctl
