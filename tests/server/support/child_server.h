// The real tessera-server as a child process.
#pragma once

#include <csignal>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <gtest/gtest.h>

namespace tessera {

class ChildServer {
 public:
  // Starts it on a free port and waits for its first line. `in_child` runs before the program takes over. An
  // empty address() means that it ended instead; error_text() then says why.
  explicit ChildServer(
      const std::filesystem::path& data_folder, const std::function<void()>& in_child = [] {},
      const std::vector<std::string>& more_arguments = {}) {
    std::vector<std::string> arguments = {TESSERA_SERVER_PROGRAM, "--data", data_folder.string()};
    if (more_arguments.empty()) {
      arguments.insert(arguments.end(), {"--listen", "127.0.0.1:0", "--workers", "1"});
    }
    arguments.insert(arguments.end(), more_arguments.begin(), more_arguments.end());
    std::vector<char*> argv;
    for (std::string& argument : arguments) {
      argv.push_back(argument.data());
    }
    argv.push_back(nullptr);
    int output[2];
    int errors[2];
    EXPECT_EQ(pipe(output), 0);
    EXPECT_EQ(pipe2(errors, O_NONBLOCK), 0);  // never blocks the child when nobody reads
    pid_ = fork();
    if (pid_ == 0) {
      dup2(output[1], STDOUT_FILENO);
      dup2(errors[1], STDERR_FILENO);
      close(output[0]);
      close(errors[0]);
      in_child();
      execv(argv[0], argv.data());
      _exit(127);
    }
    close(output[1]);
    close(errors[1]);
    output_ = output[0];
    errors_ = errors[0];
    std::string line;
    for (char c = 0; read(output_, &c, 1) == 1 && c != '\n';) {
      line += c;
    }
    const std::string prefix = "listening on ";
    if (line.starts_with(prefix)) {
      address_ = line.substr(prefix.size());
    }
  }
  ChildServer(const ChildServer&) = delete;
  ChildServer& operator=(const ChildServer&) = delete;
  ~ChildServer() {
    Stop(SIGKILL);
    close(output_);
    close(errors_);
  }

  [[nodiscard]] const std::string& address() const { return address_; }
  // Sends the signal and waits. Returns the exit code, or minus the signal that ended it.
  int Stop(int signal) {
    if (pid_ > 0) {
      kill(pid_, signal);
    }
    return Wait();
  }
  int Wait() {
    if (pid_ > 0) {
      int status = 0;
      waitpid(pid_, &status, 0);
      pid_ = -1;
      exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
    }
    return exit_code_;
  }
  // What it wrote to stderr and was not read yet.
  [[nodiscard]] std::string error_text() const {
    std::string text;
    char block[4096];
    for (ssize_t n = 0; (n = read(errors_, block, sizeof(block))) > 0;) {
      text.append(block, n);
    }
    return text;
  }

 private:
  pid_t pid_ = -1;
  int output_ = -1;
  int errors_ = -1;
  int exit_code_ = 0;
  std::string address_;
};

}  // namespace tessera
