// Reads the oracles of tests/oracles: JSON objects of decimal strings.
#pragma once

#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace oracle {

/// A JSON value of what the oracles use: strings, numbers (kept as text), arrays and objects.
class Value {
 public:
  /// The member called `key`; std::out_of_range names what is missing.
  [[nodiscard]] const Value& operator[](std::string_view key) const {
    const auto found = members_.find(std::string(key));
    if (found == members_.end()) throw std::out_of_range("no member " + std::string(key));
    return found->second;
  }
  [[nodiscard]] const Value& operator[](std::size_t index) const { return items_.at(index); }
  [[nodiscard]] const std::vector<Value>& items() const { return items_; }

  /// The decimal number, rounded once.
  [[nodiscard]] double number() const { return std::strtod(text_.c_str(), nullptr); }

  [[nodiscard]] static Value parse(std::string_view text) {
    Reader reader{text};
    return reader.value();
  }

 private:
  struct Reader {
    std::string_view text;
    std::size_t at = 0;

    char peek() {
      while (at < text.size() && std::isspace(static_cast<unsigned char>(text[at])) != 0) ++at;
      if (at == text.size()) throw std::runtime_error("the oracle ends too early");
      return text[at];
    }
    void take(char c) {
      if (peek() != c) throw std::runtime_error(std::string("the oracle lacks a ") + c);
      ++at;
    }
    std::string string() {
      take('"');
      std::string result;
      while (text.at(at) != '"') {
        if (text[at] == '\\') ++at;
        result += text.at(at++);
      }
      ++at;
      return result;
    }
    Value value() {
      Value result;
      switch (peek()) {
        case '{':
          take('{');
          while (peek() != '}') {
            std::string key = string();
            take(':');
            result.members_.emplace(std::move(key), value());
            if (peek() != '}') take(',');
          }
          take('}');
          break;
        case '[':
          take('[');
          while (peek() != ']') {
            result.items_.push_back(value());
            if (peek() != ']') take(',');
          }
          take(']');
          break;
        case '"':
          result.text_ = string();
          break;
        default:
          while (at < text.size() && std::string_view(",]} \n").find(text[at]) == text.npos) {
            result.text_ += text[at++];
          }
      }
      return result;
    }
  };

  std::string text_;
  std::vector<Value> items_;
  std::map<std::string, Value> members_;
};

/// The oracle tests/oracles/NAME.json.
[[nodiscard]] inline Value read(const std::string& name) {
  const auto path =
      std::filesystem::path(__FILE__).parent_path().parent_path() / "oracles" / (name + ".json");
  std::ifstream file(path);
  if (!file) throw std::runtime_error("cannot read " + path.string());
  return Value::parse(
      std::string(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()));
}

}  // namespace oracle
