#include "tutti/loopclosure/detector_options.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tutti/core/error.h"
#include "tutti/loopclosure/detector.h"

namespace tutti {
namespace {

TEST(LoopDetectorOptions, DefaultsAndAllPresetsAreUsable) {
  EXPECT_EQ(LoopDetectorOptions().Validate(), "");
  for (const std::string& name : KnownPresets()) {
    LoopDetectorOptions options;
    ApplyPreset(name, options);
    EXPECT_EQ(options.Validate(), "") << name;
  }
}

TEST(LoopDetectorOptions, PresetsHoldThePublishedFigures) {
  LoopDetectorOptions options;
  ApplyPreset("paper-2013", options);
  EXPECT_EQ(options.likelihood, LikelihoodKind::kSimilarity);
  EXPECT_EQ(options.stm_size, 30);
  EXPECT_EQ(options.rehearsal_similarity, 0.20);
  EXPECT_EQ(options.wm_limit, 300);
  EXPECT_EQ(options.hypothesis_ratio, 0.9);
  ApplyPreset("rtabmap-0.8.3", options);
  EXPECT_EQ(options.likelihood, LikelihoodKind::kTfIdf);
  EXPECT_EQ(options.stm_size, 10);
  EXPECT_EQ(options.propose_threshold, 0.11);
  EXPECT_EQ(options.evidence.kind, EvidenceKind::kStandardised);
  EXPECT_EQ(options.rule, CombinationRule::kMean);
  EXPECT_EQ(options.wm_limit, 0);
  EXPECT_EQ(options.hypothesis_ratio, 0.0);
  // Back to ours, whatever was set before.
  ApplyPreset("default", options);
  const LoopDetectorOptions defaults;
  EXPECT_EQ(options.stm_size, defaults.stm_size);
  EXPECT_EQ(options.loop_threshold, defaults.loop_threshold);
  EXPECT_EQ(options.wm_limit, defaults.wm_limit);
  EXPECT_EQ(options.rehearsal, defaults.rehearsal);
  EXPECT_EQ(options.rule, CombinationRule::kJoint);
  EXPECT_EQ(options.evidence.kind, EvidenceKind::kCounts);
}

TEST(LoopDetectorOptions, OptionsOfVerificationOutOfRangeAreRefusedByName) {
  const auto problem = [](double VerificationOptions::*field, double value) {
    LoopDetectorOptions options;
    options.verification.*field = value;
    return options.Validate();
  };
  EXPECT_EQ(problem(&VerificationOptions::homography_px, 0), "");
  EXPECT_NE(problem(&VerificationOptions::homography_px, -1).find("homography_px"), std::string::npos);
  EXPECT_EQ(problem(&VerificationOptions::static_px, 0), "");
  EXPECT_NE(problem(&VerificationOptions::static_px, -1).find("static_px"), std::string::npos);
}

TEST(LoopDetectorOptions, AnUnknownPresetIsRefusedWithTheNearest) {
  LoopDetectorOptions options;
  try {
    ApplyPreset("paper2013", options);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("did you mean 'paper-2013'"), std::string::npos);
  }
}

TEST(LoopDetectorOptions, ValuesOutOfRangeAreNamed) {
  const auto problem = [](auto change) {
    LoopDetectorOptions options;
    change(options);
    return options.Validate();
  };
  EXPECT_NE(problem([](auto& o) { o.wm_limit = -1; }).find("wm_limit"), std::string::npos);
  EXPECT_NE(problem([](auto& o) { o.recent_share = 1; }).find("recent_share"), std::string::npos);
  EXPECT_NE(problem([](auto& o) { o.retrieval = -2; }).find("retrieval"), std::string::npos);
  EXPECT_NE(problem([](auto& o) { o.time_budget_ms = -2; }).find("time_budget_ms"), std::string::npos);
  EXPECT_NE(problem([](auto& o) { o.extraction.features = 0; }).find("features"), std::string::npos);
  EXPECT_NE(problem([](auto& o) { o.hypothesis_ratio = 2; }).find("hypothesis_ratio"), std::string::npos);
  EXPECT_NE(problem([](auto& o) { o.members = {"sirf"}; }).find("did you mean 'surf'"), std::string::npos);
  EXPECT_EQ(problem([](auto& o) {
              o.members = {"mine", "orb"};
              o.external_members = {"mine"};
            }),
            "");
}

// Each beside the same without the other half.
TEST(LoopDetectorOptions, ChoicesThatContradictEachOtherAreRefused) {
  const auto problem = [](auto change) {
    LoopDetectorOptions options;
    change(options);
    return options.Validate();
  };
  const auto single = [&](std::vector<std::string> members) {
    return problem([&](auto& o) {
      o.rule = CombinationRule::kSingle;
      o.members = members;
    });
  };
  EXPECT_EQ(single({"orb"}), "");
  EXPECT_NE(single({"orb", "sift"}).find("exactly one member, not 2"), std::string::npos);
  const auto with_rule = [&](CombinationRule rule, MemoryKind memory, EvidenceKind evidence) {
    return problem([&](auto& o) {
      o.rule = rule;
      o.memory = memory;
      o.evidence.kind = evidence;
    });
  };
  EXPECT_EQ(with_rule(CombinationRule::kMean, MemoryKind::kPerMember, EvidenceKind::kStandardised), "");
  EXPECT_NE(with_rule(CombinationRule::kJoint, MemoryKind::kPerMember, EvidenceKind::kCounts).find("memory"),
            std::string::npos);
  EXPECT_NE(with_rule(CombinationRule::kJoint, MemoryKind::kShared, EvidenceKind::kStandardised)
                .find("evidence.kind"),
            std::string::npos);
  const auto deepest = [&](double depth) {
    return problem([=](auto& o) { o.verification.max_depth_m = depth; });
  };
  const double nearest = VerificationOptions().min_depth_m;
  EXPECT_EQ(deepest(2 * nearest), "");
  EXPECT_NE(deepest(nearest).find("min_depth_m must be below"), std::string::npos);
  EXPECT_NE(problem([](auto& o) { o.dense_members = {"mine"}; }).find("external_members"), std::string::npos);
}

}  // namespace
}  // namespace tutti
