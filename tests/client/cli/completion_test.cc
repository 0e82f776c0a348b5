#include "client/cli/completion.h"

#include <gtest/gtest.h>

#include "client/cli/commands.h"

namespace tessera::cli {
namespace {

TEST(CompletionTest, ListsCommandsAndOptionsOfEveryLevel) {
  CLI::App app("test", "tessera");
  Session session{std::stop_token()};
  app.add_flag("--json", session.json);
  AddTileSetCommands(app, session);
  const std::string script = BashCompletion(app);
  EXPECT_NE(script.find("'') words='tileset "), std::string::npos) << script;
  EXPECT_NE(script.find("'tileset') words='synthesize list show pull certify sheet thumbnail mips delete "),
            std::string::npos);
  const size_t synthesize = script.find("'tileset synthesize') words='");
  ASSERT_NE(synthesize, std::string::npos);
  const std::string line = script.substr(synthesize, script.find('\n', synthesize) - synthesize);
  for (const char* option : {"--arrangement", "--tile", "--strip", "--detach", "--json"}) {
    EXPECT_NE(line.find(option), std::string::npos) << option;
  }
}

}  // namespace
}  // namespace tessera::cli
