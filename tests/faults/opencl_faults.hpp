// Makes a chosen OpenCL call fail. The library stands between a program and OpenCL: linked before it, or
// loaded with LD_PRELOAD, where the environment arms it.
//
//   DPR_FAULT=NAME:N   the N-th call of NAME fails; NAME may end in '*', as clEnqueue*
//   DPR_FAULT_LOG=FILE at its end the process writes "NAME CALLS" of every function there, and of the one
//                      that failed " failed"
//   DPR_LOST_QUEUE=Q:N the N-th call on the Q-th command queue that is made (from 0) fails, and all after
//                      it, as if its device had vanished
//   DPR_SKIPPED_KERNEL=NAME  launches of that kernel do nothing, and nothing says so
//   DPR_SLOW_QUEUE=Q:T every call on the Q-th that waits takes T microseconds longer, as over a network
#pragma once

#include <cstddef>

namespace dpr::test {

/// From now on the `nth` call (from 1) of a function fails, by any thread, with the code that the function is
/// likeliest to fail with.
extern "C" void dpr_arm_opencl_fault(const char* name, std::size_t nth);
/// No call fails any more. Returns whether one did.
extern "C" bool dpr_disarm_opencl_fault();
/// Calls since the last arming of the functions that `name` matches.
extern "C" std::size_t dpr_opencl_calls(const char* name);
/// From now on the `nth` call (from 1) on a command queue fails, and all after it, as if its device had
/// vanished. 0: none does. For as long as the queue lives.
extern "C" void dpr_lose_queue(void* queue, std::size_t nth);
/// From now on every call on a command queue that waits takes so much longer, as over a network.
extern "C" void dpr_slow_queue(void* queue, unsigned microseconds);
/// True if the calling thread is within an OpenCL call.
extern "C" bool dpr_is_within_opencl();

}  // namespace dpr::test
