#pragma once

#include <functional>
#include <iosfwd>
#include <string>
#include <vector>

namespace dtact::ctl::guided {

/// What the user typed since it was last asked.
struct Typed {
  enum class Kind { nothing, line, end, interrupted };
  Kind kind = Kind::nothing;
  std::string line;  ///< Without blanks around it.
};

/// Where the session speaks with its user; the tests play one.
class Console {
 public:
  Console() = default;
  Console(const Console&) = delete;
  Console& operator=(const Console&) = delete;
  virtual ~Console() = default;

  /// A person at a terminal: live pictures are drawn, and a line may come at any time. Else lines
  /// lie ready, each for one prompt.
  [[nodiscard]] virtual bool interactive() const = 0;
  /// Does not wait.
  [[nodiscard]] virtual Typed typed() = 0;
  /// Ctrl-C was pressed.
  [[nodiscard]] virtual bool interrupted() const = 0;
  /// One or several lines, to stay.
  virtual void say(const std::string& text) = 0;
  /// Lines that stand until the next call takes their place. Nothing where no person watches.
  virtual void live(const std::vector<std::string>& lines) = 0;
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
  void live(const std::vector<std::string>& lines) override;

 private:
  /// Reads what lies ready.
  void fetch();
  void clear_live();

  int in_;
  std::ostream& out_;
  bool interactive_;
  std::function<bool()> interrupted_;
  std::string buffer_;
  bool ended_ = false;
  std::size_t live_lines_ = 0;
};

}  // namespace dtact::ctl::guided
