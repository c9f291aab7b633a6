#include "firmware/host/write_file.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <iterator>
#include <string>

namespace cutforce::firmware::host {
namespace {

class WriteFile : public testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        std::filesystem::temp_directory_path() / ("cutforce_write_" + std::to_string(::getpid()));
    std::filesystem::create_directory(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] static std::string content(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  [[nodiscard]] long entries() const {
    return std::distance(std::filesystem::directory_iterator(folder_), {});
  }

  std::filesystem::path folder_;
};

TEST_F(WriteFile, WritesAndReplacesAndLeavesNothingElse) {
  const auto path = folder_ / "a.toml";
  ASSERT_TRUE(write_file(path, "one\n"));
  EXPECT_EQ(content(path), "one\n");
  ASSERT_TRUE(write_file(path, std::string(1000000, 'x')));
  EXPECT_EQ(content(path).size(), 1000000U);
  EXPECT_EQ(entries(), 1);
}

TEST_F(WriteFile, KeepsTheModeOfTheFileItReplaces) {
  const auto path = folder_ / "a.toml";
  ASSERT_TRUE(write_file(path, "one"));
  ::chmod(path.c_str(), 0640);
  ASSERT_TRUE(write_file(path, "two"));
  struct stat after {};
  ASSERT_EQ(::stat(path.c_str(), &after), 0);
  EXPECT_EQ(after.st_mode & 0777U, 0640U);
}

TEST_F(WriteFile, ReplacesWhatALinkPointsTo) {
  std::filesystem::create_symlink("real.toml", folder_ / "link.toml");
  std::ofstream(folder_ / "real.toml") << "old";
  ASSERT_TRUE(write_file(folder_ / "link.toml", "new"));
  EXPECT_TRUE(std::filesystem::is_symlink(folder_ / "link.toml"));
  EXPECT_EQ(content(folder_ / "real.toml"), "new");
}

TEST_F(WriteFile, LeavesNothingBehindWhereItFails) {
  std::filesystem::create_directory(folder_ / "taken");
  std::ofstream(folder_ / "taken" / "inside") << "x";
  const auto refused = write_file(folder_ / "taken", "text");
  ASSERT_FALSE(refused);
  EXPECT_FALSE(refused.error().remedy.empty());
  EXPECT_EQ(entries(), 1);
  EXPECT_FALSE(write_file(folder_ / "no" / "such" / "folder.toml", "text"));
  EXPECT_TRUE(write_file("/dev/null", "text"));
}

}  // namespace
}  // namespace cutforce::firmware::host
