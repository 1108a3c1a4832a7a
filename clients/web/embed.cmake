# cmake -DFOLDER=… -DOUT=… -P embed.cmake: writes a source file that has the files of FOLDER in it; all of
# them, by the assembler's .incbin. Without FOLDER there are none.
set(files)
if(FOLDER)
  file(GLOB_RECURSE files RELATIVE ${FOLDER} LIST_DIRECTORIES false ${FOLDER}/*)
  if(NOT EXISTS ${FOLDER}/index.html)
    message(FATAL_ERROR "${FOLDER}: there is no index.html; name the folder that the page was built into")
  endif()
endif()
set(number 0)
set(data)
set(list)
foreach(name IN LISTS files)
  string(APPEND data "asm(\".pushsection .rodata\\n.balign 16\\ndtact_page_${number}:\\n.incbin \\\"${FOLDER}/${name}\\\"\\ndtact_page_${number}_end:\\n.popsection\\n\");
extern const char begin_${number}[] asm(\"dtact_page_${number}\");
extern const char end_${number}[] asm(\"dtact_page_${number}_end\");
")
  string(APPEND list "      BuiltIn{\"${name}\", {begin_${number}, static_cast<std::size_t>(end_${number} - begin_${number})}},\n")
  math(EXPR number "${number} + 1")
endforeach()
if(number EQUAL 0)
  set(body "  return {};\n")
else()
  set(body "  static const std::array<BuiltIn, ${number}> files{{\n${list}  }};\n  return files;\n")
endif()
file(WRITE ${OUT}.new "#include <array>
#include <cstddef>

#include \"clients/web/built_in.hpp\"

${data}
namespace dtact::web {

std::span<const BuiltIn> built_in_page() {
${body}}

}  // namespace dtact::web
")
# Compilers do not report the file of .incbin as a dependency: always a new file.
file(RENAME ${OUT}.new ${OUT})
