// The server serves the page's files and nothing else.
#include "clients/web/page.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

namespace dtact::web {
namespace {

namespace fs = std::filesystem;

class PageFolder : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "dtact_page_XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override { fs::remove_all(folder_); }
  void write(const std::string& name, const std::string& text) {
    fs::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name) << text;
  }
  std::string complaint() {
    try {
      const Page page(folder_);
    } catch (const std::exception& e) {
      return e.what();
    }
    return "";
  }

  fs::path folder_;
};

TEST_F(PageFolder, IsServedByItsPaths) {
  write("index.html", "<p>");
  write("a/b.js", "1");
  const Page page(folder_);
  ASSERT_NE(page.find("/"), nullptr);
  EXPECT_EQ(page.find("/"), page.find("/index.html"));
  EXPECT_EQ(page.find("/")->bytes, "<p>");
  EXPECT_EQ(page.find("/a/b.js")->type, "text/javascript; charset=utf-8");
  for (const char* path : {"", "index.html", "/a", "/a/", "/a/../index.html", "//index.html",
                           "/../dtact_page/index.html", "/b.js"}) {
    EXPECT_EQ(page.find(path), nullptr) << path;
  }
}

TEST_F(PageFolder, ATagReportsVersionsApart) {
  write("index.html", "<p>");
  const std::string before = Page(folder_).find("/")->tag;
  EXPECT_EQ(before, Page(folder_).find("/")->tag);
  write("index.html", "<q>");
  EXPECT_NE(before, Page(folder_).find("/")->tag);
}

TEST_F(PageFolder, NamesWhatIsWrong) {
  using testing::HasSubstr;
  EXPECT_THAT(complaint(), HasSubstr("there is no index.html"));
  write("index.html", "<p>");
  write("secret.pem", "x");
  EXPECT_THAT(complaint(), HasSubstr("secret.pem: there is no content type"));
}

}  // namespace
}  // namespace dtact::web
