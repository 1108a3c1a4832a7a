#pragma once

#include <string>
#include <vector>

#include "clients/ctl/depth_picture.hpp"

namespace dtact::ctl {

/// The colours of a terminal by its TERM and COLORTERM, either of which may be null. Throws
/// cli::Failure with a sentence for one that has none.
[[nodiscard]] Palette palette_of(const char* term, const char* colorterm);

/// The terminal on standard output as a screen to draw on; as it was before once this ends.
class Screen {
 public:
  /// Throws cli::Failure when standard output is no terminal, or one without colours.
  Screen();
  ~Screen();
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;

  /// A canvas of the screen's present size.
  [[nodiscard]] Canvas canvas() const;
  /// Replaces all that is shown.
  void show(const std::vector<std::string>& lines);

 private:
  Palette palette_;
};

}  // namespace dtact::ctl
