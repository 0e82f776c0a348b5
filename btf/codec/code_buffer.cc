#include "btf/codec/code_buffer.h"

#include <algorithm>
#include <new>

#include <absl/strings/str_cat.h>

#include "btf/base/huge_pages.h"
#include "btf/base/status_macros.h"

namespace tessera {

CodeBuffer::CodeBuffer(CodeBuffer&& other) noexcept
    : memory_(std::exchange(other.memory_, {})),
      spilled_(std::move(other.spilled_)),
      view_(std::exchange(other.view_, {})) {}

CodeBuffer& CodeBuffer::operator=(CodeBuffer other) noexcept {
  std::swap(memory_, other.memory_);
  std::swap(spilled_, other.spilled_);
  std::swap(view_, other.view_);
  return *this;
}

absl::StatusOr<CodeBuffer> CodeBuffer::Create(uint64_t size, uint64_t memory_limit_bytes,
                                              const std::filesystem::path& folder) {
  if (size <= memory_limit_bytes) {
    try {
      std::vector<uint8_t> codes;
      codes.reserve(size);
      AdviseHugePages(codes.data(), codes.capacity());
      codes.resize(size);
      return CodeBuffer(std::move(codes));
    } catch (const std::bad_alloc&) {
      return absl::ResourceExhaustedError(absl::StrCat("no ", size, " bytes of memory for the codes"));
    }
  }
  TESSERA_ASSIGN_OR_RETURN(SpillFile file, SpillFile::Create(folder, size));
  CodeBuffer buffer;
  buffer.spilled_ = std::make_unique<SpillFile>(std::move(file));
  TESSERA_ASSIGN_OR_RETURN(const std::span<std::byte> bytes, buffer.spilled_->Map());
  buffer.view_ = {reinterpret_cast<uint8_t*>(bytes.data()), bytes.size()};
  return buffer;
}

absl::Status CodeBuffer::Read(uint64_t offset, std::span<uint8_t> codes) const {
  if (spilled_ != nullptr) {
    return spilled_->Read(offset, std::as_writable_bytes(codes));
  }
  std::ranges::copy(view_.subspan(offset, codes.size()), codes.begin());
  return absl::OkStatus();
}

bool operator==(const CodeBuffer& a, const CodeBuffer& b) {
  return std::ranges::equal(a.view_, b.view_);
}

std::vector<uint8_t>& CodeBuffer::Vector() {
  if (spilled_ != nullptr) {
    memory_.assign(view_.begin(), view_.end());
    view_ = memory_;
    spilled_.reset();
  }
  return memory_;
}

}  // namespace tessera
