#include "viewer/script.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/status.h"

namespace tessera::viewer {
namespace {

using ::testing::HasSubstr;

TEST(ScriptTest, ReadsEveryStep) {
  const auto steps = ParseScript(
      "{\"wait\": \"loaded\"}\n\n{\"select\": \"surface-96/wool\"}\n{\"orbit\": [3, -4.5]}\r\n"
      "{\"pan\": [1, 2]}\n{\"zoom\": 3}\n{\"light\": [120, 40]}\n{\"frames\": 2}\n"
      "{\"exposure\": -1.5}\n{\"tone\": \"filmic\"}\n{\"sky\": [90, 1.5]}\n"
      "{\"screenshot\": \"f.png\"}");
  ASSERT_TRUE(steps.ok()) << steps.status();
  ASSERT_EQ(steps->size(), 11u);
  EXPECT_EQ((*steps)[1].text, "surface-96/wool");
  EXPECT_EQ((*steps)[2].kind, ScriptStep::Kind::kOrbit);
  EXPECT_EQ((*steps)[2].second, -4.5);
  EXPECT_EQ((*steps)[7].first, -1.5);
  EXPECT_EQ((*steps)[8].text, "filmic");
  EXPECT_EQ((*steps)[9].second, 1.5);
  EXPECT_EQ((*steps)[10].text, "f.png");
}

TEST(ScriptTest, NamesTheLineThatIsWrong) {
  const std::pair<const char*, const char*> wrong[] = {
      {"{\"wait\": \"loaded\"}\nnonsense", "line 2: expected a JSON object of one key"},
      {"{\"jump\": 1}", "line 1: expected one of wait, select"},
      {"{\"orbit\": [1]}", "line 1: expected [number, number] after \"orbit\""},
      {"{\"orbit\": [1, \"2\"]}", "line 1: expected numbers after \"orbit\""},
      {"{\"zoom\": \"in\"}", "line 1: expected numbers after \"zoom\""},
      {"{\"select\": 5}", "line 1: expected a text after \"select\""},
      {"{\"sky\": [0, -1]}", "line 1: expected a strength of at least 0 after \"sky\""},
      {"{\"exposure\": 21}", "line 1: expected -20 to 20 after \"exposure\""},
      {"{\"tone\": \"loud\"}", "line 1: expected \"none\", \"reinhard\" or \"filmic\" after \"tone\""},
      {"{\"wait\": \"tea\"}", "line 1: expected \"loaded\" after \"wait\""},
      {"{\"zoom\": 1, \"frames\": 2}", "line 1: expected a JSON object of one key"}};
  for (const auto& [text, message] : wrong) {
    const auto steps = ParseScript(text);
    EXPECT_EQ(steps.status().code(), absl::StatusCode::kInvalidArgument) << text;
    EXPECT_THAT(Message(steps.status()), HasSubstr(message));
  }
}

}  // namespace
}  // namespace tessera::viewer
