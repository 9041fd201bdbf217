// What holds for every key of the configuration, whichever there are.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <type_traits>

#include "tests/support/error_of.h"
#include "tutti/core/options.h"
#include "tutti/core/text.h"
#include "tutti/slam/config.h"

namespace tutti {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

// A file with every key of a configuration; `lines[k]` is that of the k-th of DescribeConfig().
std::string FileOf(const RunConfig& config, std::vector<int>* lines = nullptr) {
  std::string text, section;
  for (const ConfigEntry& entry : DescribeConfig(config)) {
    const std::size_t dot = entry.section.find('.');
    if (entry.section != section) {
      section = entry.section;
      text += dot == std::string::npos ? section + ":\n" : "  " + section.substr(dot + 1) + ":\n";
    }
    text += (dot == std::string::npos ? "  " : "    ") + entry.name + ": " + entry.value + "\n";
    if (lines != nullptr) lines->push_back(static_cast<int>(std::count(text.begin(), text.end(), '\n')));
  }
  return text;
}

// Visits every option of a struct and of those within it.
template <class Options, class Visitor>
void ForEach(Options& options, const Visitor& visit) {
  ForEachOption(options, [&](const OptionText& text, auto& field) {
    if constexpr (kHasOptions<std::decay_t<decltype(field)>>) {
      ForEach(field, visit);
    } else {
      visit(text, field);
    }
  });
}

template <class Visitor>
void ForEach(RunConfig& config, const Visitor& visit) {
  ForEach(config.dataset, visit);
  ForEach(*config.dataset.camera, visit);
  ForEach(*config.dataset.right, visit);
  ForEach(config.odometry, visit);
  ForEach(config.loops, visit);
  ForEach(config.graph, visit);
  ForEach(config.run, visit);
}

// Another value that can be read.
void ChangeField(const OptionText& text, double& field) {
  for (const double other : {0.9 * field, 1.1 * field, 0.5, 0.05}) {
    if (other == field || !text.Refusal("", other).empty()) continue;
    field = other;
    return;
  }
  ADD_FAILURE() << text.name;
}
void ChangeField(const OptionText& /*text*/, bool& field) { field = !field; }
void ChangeField(const OptionText& /*text*/, int& field) { ++field; }
void ChangeField(const OptionText& /*text*/, std::uint64_t& field) { ++field; }
void ChangeField(const OptionText& /*text*/, std::string& field) { field = "some thing"; }
void ChangeField(const OptionText& /*text*/, std::optional<PinholeCamera>& /*visited itself*/) {}
void ChangeField(const OptionText& text, std::vector<std::string>& field) {
  if (text.in_files) field = {"sift", "orb"};
}
void ChangeField(const OptionText& /*text*/, CombinationRule& field) { field = CombinationRule::kMajority; }
void ChangeField(const OptionText& /*text*/, TransformRows& field) {
  field = {1, 0, 0, -0.5, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
}
template <std::size_t N>
void ChangeField(const OptionText& /*text*/, std::array<double, N>& field) {
  for (std::size_t i = 0; i < N; ++i) field[i] += 0.125 * static_cast<double>(i + 1);
}
template <class Enum, class = std::enable_if_t<std::is_enum_v<Enum>>>
void ChangeField(const OptionText& /*text*/, Enum& field) {
  const auto words = WordsOf(field);
  field = words.back().second == field ? words.front().second : words.back().second;
}

// The defaults, and cameras whose keys are shown, too.
RunConfig PlainConfig() {
  RunConfig config;
  config.dataset.camera = config.dataset.right = PinholeCamera();
  return config;
}

// Differs from the defaults in every key.
RunConfig ChangedConfig() {
  RunConfig config = PlainConfig();
  ForEach(config, [](const OptionText& text, auto& field) { ChangeField(text, field); });
  return config;
}

TEST(ConfigKeys, ThereAreFewEnoughToRead) {
  EXPECT_LE(DescribeConfig(PlainConfig()).size(), 150u) << "a key that only a study varies is a constant";
}

TEST(ConfigKeys, EveryKeyIsReadAsItIsShown) {
  const RunConfig plain = PlainConfig(), changed = ChangedConfig(),
                  read = ParseConfig(FileOf(changed), "my.yaml");
  const auto defaults = DescribeConfig(plain), wanted = DescribeConfig(changed), got = DescribeConfig(read);
  ASSERT_EQ(got.size(), defaults.size());
  for (std::size_t k = 0; k < wanted.size(); ++k) {
    const std::string key = wanted[k].section + "." + wanted[k].name;
    EXPECT_EQ(got[k].value, wanted[k].value) << key;
    EXPECT_TRUE(got[k].value != defaults[k].value || wanted[k].name == "preset") << key;
    EXPECT_FALSE(wanted[k].doc.empty()) << key;
  }
}

// Reads a file with the k-th numeric option at `value` of it, for all k; a value of nothing: left alone.
template <class Value, class Check>
int WithEachNumberAt(const Value& value, const Check& check) {
  int checked = 0;
  for (int k = 0, numbers = 1; k < numbers; ++k) {
    RunConfig config = ChangedConfig();
    std::optional<OptionText> set;
    numbers = 0;
    ForEach(config, [&](const OptionText& text, auto& field) {
      using Field = std::decay_t<decltype(field)>;
      if constexpr (std::is_same_v<Field, int> || std::is_same_v<Field, double>) {
        const std::optional<double> number = value(text, field);
        if (numbers++ != k || !number) return;
        field = static_cast<Field>(*number);
        set = text;
      }
    });
    if (!set) continue;
    check(config, *set);
    ++checked;
  }
  return checked;
}

void ExpectRefusedInItsLine(const RunConfig& config, const OptionText& option) {
  std::vector<int> lines;
  const std::string file = FileOf(config, &lines);
  const std::string message = testing::ErrorOf([&] { ParseConfig(file, "my.yaml"); });
  const auto wanted = DescribeConfig(ChangedConfig()), given = DescribeConfig(config);
  for (std::size_t k = 0; k < given.size(); ++k) {
    if (given[k].value == wanted[k].value) continue;
    EXPECT_THAT(message,
                AllOf(HasSubstr("my.yaml:" + std::to_string(lines[k]) + ":"),
                      HasSubstr(given[k].name + " must be " + option.Range()), HasSubstr(option.unit)));
    return;
  }
  ADD_FAILURE() << option.name << " is not shown";
}

TEST(ConfigKeys, EveryNumberOutOfItsRangeIsRefusedWithLineKeyAndRange) {
  const auto too_small = [](const OptionText& text, double) {
    return text.has_least ? std::optional<double>(text.least - (text.least_included ? 1 : 0)) : std::nullopt;
  };
  const auto too_large = [](const OptionText& text, double) {
    return text.has_most ? std::optional<double>(text.most + (text.most_included ? 1 : 0)) : std::nullopt;
  };
  EXPECT_GT(WithEachNumberAt(too_small, ExpectRefusedInItsLine), 80);
  EXPECT_GT(WithEachNumberAt(too_large, ExpectRefusedInItsLine), 25);
}

TEST(ConfigKeys, NoNumberOfACallerMayBeNan) {
  const auto nan = [](const OptionText&, auto value) {
    return std::is_same_v<decltype(value), double> ? std::optional<double>(std::nan("")) : std::nullopt;
  };
  const int checked = WithEachNumberAt(nan, [](RunConfig config, const OptionText& option) {
    const std::string message = testing::ErrorOf([&] { SetOptions({}, config); });
    EXPECT_THAT(message, AllOf(HasSubstr(option.name), HasSubstr("not nan")));
  });
  EXPECT_GT(checked, 50);
}

TEST(ConfigKeys, HelpShowsEveryBasicKeyOnce) {
  const RunConfig config = PlainConfig();
  const std::string help = HelpConfig(false);
  std::vector<std::string> lines = SplitText(help, "\n");
  int basic = 0;
  for (const ConfigEntry& entry : DescribeConfig(config)) {
    const std::string indent(entry.section.find('.') == std::string::npos ? 2 : 4, ' ');
    const std::string begin = indent + entry.name + ": " + entry.value + " ", end = "# " + entry.doc;
    const auto shown = std::count_if(lines.begin(), lines.end(), [&](const std::string& line) {
      return line.rfind(begin, 0) == 0 && line.find(end) != std::string::npos;
    });
    EXPECT_EQ(shown, entry.advanced ? 0 : 1) << entry.section << "." << entry.name;
    basic += entry.advanced ? 0 : 1;
  }
  EXPECT_GE(basic, 35);
  EXPECT_LE(basic, 45) << "what users set; a key more is to replace one";
}

}  // namespace
}  // namespace tutti
