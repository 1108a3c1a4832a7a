#pragma once

#include <cstddef>
#include <functional>
#include <iosfwd>
#include <memory>
#include <string>
#include <vector>

#include "clients/common/program.hpp"
#include "hal/files/png.hpp"

namespace dtact::ctl::guided {

/// A captured press, on the depth map.
struct CapturedPress {
  std::string name;
  double col = 0;  ///< The contact's middle, pixels.
  double row = 0;
  double radius_px = 0;
  double depth_mm = 0;  ///< Depth of its lowest point: fitted, else from the width.
};

/// The user's input since the last call.
struct Typed {
  enum class Kind { nothing, line, end, interrupted };
  Kind kind = Kind::nothing;
  std::string line;  ///< Without blanks around it.
};

/// Lines of a descriptor, which is not owned; no call waits.
class LineInput {
 public:
  explicit LineInput(int descriptor) : descriptor_(descriptor) {}

  /// Reads available input. Returns the number of lines that ended in it.
  std::size_t fetch();
  /// The next line read.
  [[nodiscard]] Typed take();

 private:
  int descriptor_;
  std::string buffer_;
  bool ended_ = false;
};

/// An input that the user may type.
struct Answer {
  std::string key;    ///< A letter; empty: Enter alone.
  std::string words;  ///< Description.
};

inline const Answer kQuit{"q", "end the session"};

/// A question to the user.
struct Prompt {
  std::string text;  ///< Empty: only the answers.
  std::vector<Answer> answers;
};

/// The prompt as lines: the text, and below it each answer behind its key in brackets.
[[nodiscard]] std::string text_of(const Prompt& prompt);

/// The display for the user until the next one.
struct Scene {
  const image::Grey8* picture = nullptr;  ///< The sensor's map now; null: unchanged.
  double mm_per_px = 0;                   ///< The picture's scale.
  std::string words;                      ///< About the picture.
  Prompt prompt;
  std::vector<CapturedPress> presses;
  double covered_mm = 0;     ///< Depth that the LUT of these presses covers; 0: no LUT.
  int presses_required = 0;  ///< Number of presses for the calibration.
};

/// The session's connection to its user; the tests play one.
class Console {
 public:
  Console() = default;
  Console(const Console&) = delete;
  Console& operator=(const Console&) = delete;
  virtual ~Console() = default;

  /// Whether a person watches: live pictures are drawn, and a line may come at any time. Otherwise
  /// each prompt reads one prepared line.
  [[nodiscard]] virtual bool interactive() const = 0;
  /// Whether the user is at this machine's terminal; otherwise paths and commands are left out.
  [[nodiscard]] virtual bool at_terminal() const { return true; }
  /// The user's input; does not wait.
  [[nodiscard]] virtual Typed typed() = 0;
  /// Whether Ctrl-C was pressed.
  [[nodiscard]] virtual bool interrupted() const = 0;
  /// Prints one or several lines that stay.
  virtual void say(const std::string& text) = 0;
  /// Prints a picture of a press that stays.
  virtual void keep(const image::Grey8& picture) = 0;
  /// Shows the scene where a person watches.
  virtual void live(const Scene& scene) = 0;
};

/// Standard input and output, or a test's replacements.
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
  /// Reads available input.
  void fetch();
  void clear_live();

  LineInput in_;
  std::ostream& out_;
  bool interactive_;
  std::function<bool()> interrupted_;
  std::size_t live_lines_ = 0;
};

/// Connects to a program that shows the session to a person, in lines of JSON
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

/// The console that the command line asks for, while a cli::Interruptible lives.
[[nodiscard]] std::unique_ptr<Console> make_console(const cli::Context& context);

}  // namespace dtact::ctl::guided
