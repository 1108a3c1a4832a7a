#include <iostream>

#include "clients/web/web.hpp"

int main(int argc, char** argv) {
  return dtact::web::run({argv + 1, argv + argc}, std::cout, std::cerr);
}
