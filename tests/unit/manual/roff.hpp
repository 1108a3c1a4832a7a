#pragma once

#include <string>
#include <string_view>

namespace dtact::manual {

/// `text` for a page in the man(7) macros: escapes signs that roff would interpret or replace
/// (every hyphen, so that options and paths can be copied), `code` becomes bold.
[[nodiscard]] std::string escaped(std::string_view text);

[[nodiscard]] std::string bold(std::string_view text);    ///< Escapes `text`.
[[nodiscard]] std::string italic(std::string_view text);  ///< Escapes `text`.

/// One paragraph of `words`, which are escaped, in lines of at most 80 columns.
[[nodiscard]] std::string filled(const std::string& words);

/// The first lines of a page, with the note that it is generated. `volume`: "User Commands".
[[nodiscard]] std::string page_head(const std::string& name, int section,
                                    const std::string& volume);

/// A section's heading, or with the macro "SS" a subsection's. `title` is escaped.
[[nodiscard]] std::string heading(const std::string& title, const char* macro = "SH");

/// An entry of a list. Both are escaped already.
[[nodiscard]] std::string entry(const std::string& tag, const std::string& body);

/// "dtactd(8)", the name bold.
[[nodiscard]] std::string reference(const std::string& name, int section);

}  // namespace dtact::manual
