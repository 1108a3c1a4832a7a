#pragma once

#include <cstddef>
#include <string>

namespace dtact::ctl::guided {

/// What the user typed since it was last asked.
struct Typed {
  enum class Kind { nothing, line, end, interrupted };
  Kind kind = Kind::nothing;
  std::string line;  ///< Without blanks around it.
};

/// Lines of a descriptor, which is not owned; nothing here waits.
class LineInput {
 public:
  explicit LineInput(int descriptor) : descriptor_(descriptor) {}

  /// Reads what lies ready. Returns how many lines ended in it.
  std::size_t fetch();
  /// The next line of what was read.
  [[nodiscard]] Typed take();

 private:
  int descriptor_;
  std::string buffer_;
  bool ended_ = false;
};

}  // namespace dtact::ctl::guided
