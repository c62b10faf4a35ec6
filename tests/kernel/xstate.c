/* SPDX-License-Identifier: Apache-2.0 */
/*
 * For linux.uml on processors whose extended state is larger than it has room for (those with AMX): it
 * reads and writes the state of its processes by ptrace(), and the host's kernel takes such a state
 * only whole. This library, preloaded, puts what linux.uml does not know behind what it does.
 */
#include <dlfcn.h>
#include <elf.h>
#include <errno.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/types.h>
#include <sys/uio.h>

typedef long ptrace_fn(enum __ptrace_request request, ...);

/* Larger than any that processors have. */
#define STATE_MAX 65536

static long read_state(ptrace_fn *call, pid_t pid, unsigned char *state, struct iovec *whole)
{
	*whole = (struct iovec){ .iov_base = state, .iov_len = STATE_MAX };
	return call(PTRACE_GETREGSET, pid, (void *)NT_X86_XSTATE, whole);
}

static long exchange_state(ptrace_fn *call, enum __ptrace_request request, pid_t pid,
                           struct iovec *known)
{
	static unsigned char state[STATE_MAX];
	struct iovec whole;
	long result = read_state(call, pid, state, &whole);

	if (result < 0)
		return result;
	if (known->iov_len > whole.iov_len)
		known->iov_len = whole.iov_len;
	if (request == PTRACE_GETREGSET) {
		memcpy(known->iov_base, state, known->iov_len);
		return result;
	}
	memcpy(state, known->iov_base, known->iov_len);
	return call(request, pid, (void *)NT_X86_XSTATE, &whole);
}

__attribute__((visibility("default"))) long ptrace(enum __ptrace_request request, ...)
{
	static ptrace_fn *call;
	va_list list;
	pid_t pid;
	void *address;
	void *data;

	va_start(list, request);
	pid = va_arg(list, pid_t);
	address = va_arg(list, void *);
	data = va_arg(list, void *);
	va_end(list);
	if (!call)
		*(void **)&call = dlsym(RTLD_NEXT, "ptrace");
	if (!call) {
		errno = ENOSYS;
		return -1;
	}
	if ((request == PTRACE_GETREGSET || request == PTRACE_SETREGSET) &&
	    address == (void *)NT_X86_XSTATE)
		return exchange_state(call, request, pid, data);
	return call(request, pid, address, data);
}
