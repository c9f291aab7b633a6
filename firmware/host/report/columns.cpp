#include "firmware/host/report/columns.hpp"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <memory>
#include <system_error>

namespace cutforce::firmware::host {
namespace {

using hal::host::InputError;

constexpr std::size_t kLongestLine = 65536;

struct CloseGzip {
  void operator()(gzFile file) const { gzclose_r(file); }
};
using GzipFile = std::unique_ptr<gzFile_s, CloseGzip>;

void split(std::string_view line, std::vector<std::string_view>& cells) {
  cells.clear();
  while (true) {
    const auto comma = line.find(',');
    std::string_view cell = line.substr(0, comma);
    while (cell.starts_with(' ')) cell.remove_prefix(1);
    while (cell.ends_with(' ')) cell.remove_suffix(1);
    cells.push_back(cell);
    if (comma == std::string_view::npos) return;
    line.remove_prefix(comma + 1);
  }
}

class Reader {
 public:
  Reader(const std::filesystem::path& path, const WantedColumns& wanted)
      : path_(path), wanted_(wanted) {}

  std::expected<Columns, InputError> run() {
    const GzipFile file(gzopen(path_.c_str(), "rb"));
    if (!file) return fail("the file cannot be opened", "check that it exists and may be read");
    gzbuffer(file.get(), 1U << 17);
    std::string line(kLongestLine, '\0');
    while (gzgets(file.get(), line.data(), static_cast<int>(line.size())) != nullptr) {
      ++line_;
      std::string_view text(line.data());
      if (!text.ends_with('\n') && text.size() + 1 >= line.size())
        return fail("the line is longer than 64 KiB", "check that this is a CSV file");
      // zlib hands out what it has before it says that the rest is missing.
      if (!text.ends_with('\n') && damaged(file.get())) return cut_short();
      while (text.ends_with('\n') || text.ends_with('\r')) text.remove_suffix(1);
      if (text.empty() || text.starts_with('#')) continue;
      if (auto taken = header_read_ ? row(text) : header(text); !taken)
        return std::unexpected(taken.error());
    }
    if (damaged(file.get())) return cut_short();
    if (!header_read_) return fail("there is no header of column names", "check the file");
    return finish();
  }

 private:
  struct Place {
    std::size_t cell;
    std::string_view name;
    std::vector<double>* numbers;
    Words* words;
  };

  std::unexpected<InputError> fail(std::string what, std::string remedy) const {
    return std::unexpected(InputError{path_.string() + ":" + std::to_string(line_), std::move(what),
                                      std::move(remedy)});
  }

  static bool damaged(gzFile file) {
    int error = Z_OK;
    gzerror(file, &error);
    return error != Z_OK && error != Z_STREAM_END;
  }
  std::unexpected<InputError> cut_short() const {
    return fail("the compressed file is damaged or cut short", "write or copy it again");
  }

  std::expected<void, InputError> header(std::string_view text) {
    split(text, cells_);
    header_read_ = true;
    for (std::size_t k = 0; k < cells_.size(); ++k) {
      const auto wanted = [&](const std::vector<std::string_view>& list) {
        return std::find(list.begin(), list.end(), cells_[k]);
      };
      if (cells_[k] == "t_s")
        places_.push_back({k, "t_s", &columns_.numbers["t_s"], nullptr});
      else if (const auto number = wanted(wanted_.numbers); number != wanted_.numbers.end())
        places_.push_back({k, *number, &columns_.numbers[std::string(*number)], nullptr});
      else if (const auto word = wanted(wanted_.words); word != wanted_.words.end())
        places_.push_back({k, *word, nullptr, &columns_.words[std::string(*word)]});
    }
    if (!columns_.numbers.contains("t_s"))
      return fail("there is no column t_s", "give every row its time in seconds");
    return {};
  }

  std::expected<void, InputError> row(std::string_view text) {
    split(text, cells_);
    for (const auto& place : places_) {
      const std::string_view cell = place.cell < cells_.size() ? cells_[place.cell] : "";
      if (place.words != nullptr) {
        take_word(*place.words, cell);
        continue;
      }
      double value = std::numeric_limits<double>::quiet_NaN();
      if (!cell.empty()) {
        const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
        if (error != std::errc{} || end != cell.data() + cell.size())
          return fail(
              "column " + std::string(place.name) + " holds no number: " + std::string(cell),
              "write a decimal number, or leave the cell empty");
      }
      if (place.name == "t_s" && !(value > last_s_))
        return fail("time does not increase", "sort the rows and remove doubled ones");
      if (place.name == "t_s") last_s_ = value;
      place.numbers->push_back(value);
    }
    return {};
  }

  static void take_word(Words& words, std::string_view cell) {
    // Rows repeat the last word most of the time.
    if (!words.index.empty() && words.dictionary[words.index.back()] == cell) {
      words.index.push_back(words.index.back());
      return;
    }
    auto found = std::find(words.dictionary.begin(), words.dictionary.end(), cell);
    if (found == words.dictionary.end()) found = words.dictionary.emplace(found, cell);
    words.index.push_back(static_cast<std::uint32_t>(found - words.dictionary.begin()));
  }

  Columns finish() {
    std::erase_if(columns_.numbers, [](const auto& column) {
      return column.first != "t_s" && std::none_of(column.second.begin(), column.second.end(),
                                                   [](double x) { return std::isfinite(x); });
    });
    return std::move(columns_);
  }

  const std::filesystem::path& path_;
  const WantedColumns& wanted_;
  Columns columns_;
  std::vector<Place> places_;
  std::vector<std::string_view> cells_;
  std::size_t line_ = 0;
  bool header_read_ = false;
  double last_s_ = -std::numeric_limits<double>::infinity();
};

}  // namespace

const std::vector<double>* Columns::find(std::string_view name) const {
  const auto found = numbers.find(name);
  return found == numbers.end() || found->second.empty() ? nullptr : &found->second;
}

std::expected<Columns, hal::host::InputError> read_columns(const std::filesystem::path& path,
                                                           const WantedColumns& wanted) {
  return Reader(path, wanted).run();
}

}  // namespace cutforce::firmware::host
