#pragma once

#include <cstddef>
#include <functional>
#include <iosfwd>
#include <string>
#include <vector>

#include "hal/files/png.hpp"

namespace dtact::ctl::guided {

/// A press that was taken, on the depth map.
struct CapturedPress {
  std::string name;
  double col = 0;  ///< The contact's middle, pixels.
  double row = 0;
  double radius_px = 0;
  double depth_mm = 0;  ///< Depth of its lowest point: fitted, else by the contact's width.
};

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

/// What the user may type.
struct Answer {
  std::string key;    ///< A letter; empty: Enter alone.
  std::string words;  ///< What it does.
};

inline const Answer kQuit{"q", "end the session"};

/// What the user is asked.
struct Prompt {
  std::string text;  ///< Empty: nothing but the answers.
  std::vector<Answer> answers;
};

/// The prompt as lines: the text, and below it each answer behind its key in brackets.
[[nodiscard]] std::string text_of(const Prompt& prompt);

/// What stands before the user until the next takes its place.
struct Scene {
  const image::Grey8* picture = nullptr;  ///< The sensor now, the map's part; null: as before.
  double mm_per_px = 0;                   ///< The picture's scale.
  std::string words;                      ///< About the picture.
  Prompt prompt;
  std::vector<CapturedPress> presses;
  double covered_mm = 0;     ///< How deep the LUT of these presses reaches; 0: there is none.
  int presses_required = 0;  ///< Number of presses for the calibration.
};

/// Where the session speaks with its user; the tests play one.
class Console {
 public:
  Console() = default;
  Console(const Console&) = delete;
  Console& operator=(const Console&) = delete;
  virtual ~Console() = default;

  /// A person watches: live pictures are drawn, and a line may come at any time. Else lines lie
  /// ready, each for one prompt.
  [[nodiscard]] virtual bool interactive() const = 0;
  /// The user sits at this machine's terminal; else paths and commands mean nothing to them.
  [[nodiscard]] virtual bool at_terminal() const { return true; }
  /// Does not wait.
  [[nodiscard]] virtual Typed typed() = 0;
  /// Ctrl-C was pressed.
  [[nodiscard]] virtual bool interrupted() const = 0;
  /// One or several lines, to stay.
  virtual void say(const std::string& text) = 0;
  /// A picture of a press, to stay.
  virtual void keep(const image::Grey8& picture) = 0;
  /// Nothing where no person watches.
  virtual void live(const Scene& scene) = 0;
};

/// Standard input and output, or what a test puts in their places.
class StreamConsole : public Console {
 public:
  /// `in`: a descriptor, not owned. `interactive`: both are a terminal.
  StreamConsole(int in, std::ostream& out, bool interactive, std::function<bool()> interrupted);
  ~StreamConsole() override;

  [[nodiscard]] bool interactive() const override { return interactive_; }
  [[nodiscard]] Typed typed() override;
  [[nodiscard]] bool interrupted() const override { return interrupted_(); }
  void say(const std::string& text) override;
  void keep(const image::Grey8& picture) override;
  void live(const Scene& scene) override;

 private:
  /// Reads what lies ready.
  void fetch();
  void clear_live();

  LineInput in_;
  std::ostream& out_;
  bool interactive_;
  std::function<bool()> interrupted_;
  std::size_t live_lines_ = 0;
};

/// Speaks with a program that shows the session to a person, in lines of JSON
/// (clients/common/guided.proto).
class JsonConsole : public Console {
 public:
  /// `in`: a descriptor, not owned.
  JsonConsole(int in, std::ostream& out, std::function<bool()> interrupted);

  [[nodiscard]] bool at_terminal() const override { return false; }
  [[nodiscard]] bool interactive() const override { return true; }
  [[nodiscard]] Typed typed() override;
  [[nodiscard]] bool interrupted() const override { return interrupted_(); }
  void say(const std::string& text) override;
  void keep(const image::Grey8&) override {}
  void live(const Scene& scene) override;

 private:
  LineInput in_;
  std::ostream& out_;
  std::function<bool()> interrupted_;
};

}  // namespace dtact::ctl::guided
