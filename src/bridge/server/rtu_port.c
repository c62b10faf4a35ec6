/* SPDX-License-Identifier: Apache-2.0 */
#include "server/rtu_port.h"

#include "drivebridge/clock.h"

#include "transport/serial.h"

#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/prctl.h>
#include <time.h>
#include <unistd.h>

/* Frames that wait for the network thread: requests of one PLC, which waits for the answer to each,
 * and broadcasts. */
#define FRAMES 8
/* Adapters make gaps inside frames: an incomplete one is given up after this time. */
#define PATIENCE (20 * DB_NS_PER_MS)
/* Between two attempts to open a port. */
#define RETRY (500 * DB_NS_PER_MS)
/* Longest time for the port to take an answer. */
#define WRITE_TIME (2 * DB_NS_PER_S)
#define READ_SIZE 512
#define STACK_SIZE ((size_t)256 * 1024)
#define EXCEPTION_FLAG 0x80u

struct db_rtu_port {
	struct db_rtu_config config; /* with texts of its own */
	int wake_fd;                 /* network to thread */
	int notify_fd;               /* thread to network */
	atomic_bool begun;
	atomic_bool ending;

	pthread_mutex_t lock; /* protects the following, and is held to copy only */
	struct db_rtu_figures figures;
	struct db_rtu_frame frames[FRAMES];
	unsigned first;
	unsigned count;
	uint32_t answer_number; /* 0: there is no answer to send */
	uint16_t answer_length;
	uint8_t answer[DB_RTU_FRAME_MAX];

	/* Of the thread only. */
	struct db_serial *serial;
	db_time character;
	db_time silence;
	struct db_rtu_burst burst;
	struct db_rtu_echo echo;
	uint32_t last_number;
	uint32_t awaited; /* number of the request whose answer the PLC waits for; 0 */
	db_time awaited_at;
};

static void signal_fd(int fd)
{
	const uint64_t one = 1;

	/* It cannot fail but for a counter that is full, which is as good as raised. */
	(void)!write(fd, &one, sizeof(one));
}

static void clear_fd(int fd)
{
	uint64_t raised;

	(void)!read(fd, &raised, sizeof(raised));
}

static void free_port(struct db_rtu_port *port)
{
	free(port->config.name);
	free(port->config.device);
	if (port->wake_fd >= 0)
		close(port->wake_fd);
	if (port->notify_fd >= 0)
		close(port->notify_fd);
	pthread_mutex_destroy(&port->lock);
	free(port);
}

/* --- the thread: frames ----------------------------------------------------------------------- */

/* Hands a frame to the network thread. The first one gives way when there is no room: nobody waits
 * for its answer any more. */
static void post_frame(struct db_rtu_port *port, const uint8_t *bytes, size_t length,
                       uint32_t number)
{
	struct db_rtu_frame *frame;

	pthread_mutex_lock(&port->lock);
	if (port->count == FRAMES) {
		port->first = (port->first + 1) % FRAMES;
		port->count--;
		port->figures.missed++;
	}
	/* A request that was not taken yet, and has no answer to expect: its PLC gave it up. */
	for (unsigned i = 0; number != 0 && i < port->count; i++) {
		struct db_rtu_frame *other = &port->frames[(port->first + i) % FRAMES];

		port->figures.missed += other->number != 0;
		if (other->number != 0)
			other->length = 0;
	}
	frame = &port->frames[(port->first + port->count++) % FRAMES];
	frame->number = number;
	frame->at = port->burst.last;
	frame->length = (uint16_t)length;
	memcpy(frame->bytes, bytes, length);
	pthread_mutex_unlock(&port->lock);
	signal_fd(port->notify_fd);
}

/* A silence: what was received before it is frames, or nothing. `patient`: an incomplete frame may
 * go on. `waits`: nothing was received since, so that a PLC may wait for an answer. */
static void end_burst(struct db_rtu_port *port, bool patient, bool waits)
{
	struct db_rtu_burst *burst = &port->burst;
	struct db_rtu_piece pieces[DB_RTU_PIECES_MAX];
	size_t count = db_rtu_burst_cut(burst, pieces);
	size_t begin = 0;

	if (count == 0 && patient)
		return;
	if (count == 0) {
		pthread_mutex_lock(&port->lock);
		port->figures.bad += !burst->overrun;
		port->figures.overruns += burst->overrun;
		pthread_mutex_unlock(&port->lock);
	} else if (db_rtu_echo_take(&port->echo, burst->bytes + pieces[0].at, pieces[0].length,
	                            port->silence, burst->began)) {
		begin = 1;
		pthread_mutex_lock(&port->lock);
		port->figures.echoes++;
		pthread_mutex_unlock(&port->lock);
	}
	for (size_t i = begin; i < count; i++) {
		const uint8_t *bytes = burst->bytes + pieces[i].at;
		uint8_t unit = bytes[0];
		bool ours = db_rtu_has_unit(&port->config, unit) &&
		            (bytes[1] & EXCEPTION_FLAG) == 0;
		/* Only the last one of a burst can be a request that still waits for its answer; a
		 * broadcast has none. */
		bool last = waits && i + 1 == count;

		pthread_mutex_lock(&port->lock);
		port->figures.frames++;
		port->figures.foreign += unit != 0 && !ours;
		port->figures.missed += ours && !last;
		pthread_mutex_unlock(&port->lock);
		if (unit == 0) {
			post_frame(port, bytes, pieces[i].length, 0);
		} else if (ours && last) {
			if (++port->last_number == 0)
				port->last_number = 1;
			port->awaited = port->last_number;
			port->awaited_at = port->burst.last;
			post_frame(port, bytes, pieces[i].length, port->last_number);
		}
	}
	db_rtu_burst_clear(burst);
}

/* False when the port is lost. `hung_up`: it is when there is nothing more to read. */
static bool receive_bytes(struct db_rtu_port *port, bool hung_up, int *error)
{
	uint8_t bytes[READ_SIZE];
	ssize_t got = db_serial_read(port->serial, bytes, sizeof(bytes));
	db_time now = db_clock_now();

	if (got < 0) {
		*error = (int)-got;
		return false;
	}
	if (got == 0)
		return !hung_up;
	/* What came before this silence was not looked at in time. */
	if (port->burst.used > 0 && now - port->burst.last >= port->silence)
		end_burst(port, now - port->burst.last < PATIENCE, false);
	/* Whoever sends does not wait for an answer. */
	port->awaited = 0;
	db_rtu_burst_add(&port->burst, bytes, (size_t)got, port->silence, now);
	return true;
}

/* --- the thread: answers ---------------------------------------------------------------------- */

static bool write_all(struct db_rtu_port *port, const uint8_t *bytes, size_t length, int *error)
{
	db_time until = db_clock_now() + WRITE_TIME;
	size_t sent = 0;

	while (sent < length) {
		struct pollfd poll_fd = { .fd = db_serial_fd(port->serial), .events = POLLOUT };
		ssize_t count = db_serial_write(port->serial, bytes + sent, length - sent);

		if (count < 0 || (count == 0 && db_clock_now() >= until)) {
			*error = count < 0 ? (int)-count : ETIMEDOUT;
			return false;
		}
		sent += (size_t)count;
		if (sent < length)
			(void)poll(&poll_fd, 1, 100);
	}
	return true;
}

/* False when the port is lost. */
static bool send_answer(struct db_rtu_port *port, int *error)
{
	uint8_t bytes[DB_RTU_FRAME_MAX];
	size_t length;
	uint32_t number;
	bool waits;
	db_time now;

	pthread_mutex_lock(&port->lock);
	number = port->answer_number;
	length = port->answer_length;
	memcpy(bytes, port->answer, length);
	port->answer_number = 0;
	pthread_mutex_unlock(&port->lock);
	if (number == 0)
		return true;
	/* What has arrived meanwhile is the next request, or another device's answer. */
	if (!receive_bytes(port, false, error))
		return false;
	now = db_clock_now();
	waits = number == port->awaited &&
	        now - port->awaited_at < (db_time)port->config.answer_timeout_ms * DB_NS_PER_MS;
	if (number == port->awaited)
		port->awaited = 0;
	if (waits && !write_all(port, bytes, length, error))
		return false;
	if (waits)
		db_rtu_echo_sent(&port->echo, bytes, length, port->character * (db_time)length,
		                 now);
	pthread_mutex_lock(&port->lock);
	port->figures.answers += waits;
	if (waits)
		port->figures.sent = number;
	port->figures.late += !waits;
	pthread_mutex_unlock(&port->lock);
	return true;
}

/* --- the thread: the port --------------------------------------------------------------------- */

/* The port is open (error 0), or is not for this reason. */
static void note_state(struct db_rtu_port *port, int error)
{
	bool changed;

	pthread_mutex_lock(&port->lock);
	changed = port->figures.up != (error == 0) || port->figures.error != error;
	port->figures.up = error == 0;
	port->figures.error = error;
	port->figures.openings += error == 0;
	/* What waits is of a PLC that is gone. */
	port->count = 0;
	port->answer_number = 0;
	pthread_mutex_unlock(&port->lock);
	if (changed)
		signal_fd(port->notify_fd);
}

static void close_port(struct db_rtu_port *port, int error)
{
	db_serial_close(port->serial);
	port->serial = NULL;
	if (error != 0)
		note_state(port, error);
}

/* Waits for bytes, for the network thread, or for what was received so far to be looked at. */
static void wait_for_work(struct db_rtu_port *port, bool *readable, bool *lost)
{
	bool begun = atomic_load(&port->begun);
	db_time now = db_clock_now();
	db_time deadline = DB_TIME_NEVER;
	struct pollfd fds[] = {
		{ .fd = port->wake_fd, .events = POLLIN },
		{ .fd = port->serial ? db_serial_fd(port->serial) : -1, .events = POLLIN },
	};
	struct timespec time = { 0 };
	db_time left;

	if (begun && !port->serial)
		deadline = now + RETRY;
	else if (begun && port->burst.used > 0)
		deadline = port->burst.last +
		           (now - port->burst.last < port->silence ? port->silence : PATIENCE);
	left = deadline == DB_TIME_NEVER ? 0 : deadline - now;
	if (left > 0)
		time = (struct timespec){ .tv_sec = left / DB_NS_PER_S,
			                  .tv_nsec = left % DB_NS_PER_S };
	if (ppoll(fds, 2, deadline == DB_TIME_NEVER ? NULL : &time, NULL) <= 0) {
		*readable = *lost = false;
		return;
	}
	if (fds[0].revents & POLLIN)
		clear_fd(port->wake_fd);
	*readable = fds[1].revents & POLLIN;
	*lost = fds[1].revents & (POLLERR | POLLHUP | POLLNVAL);
}

static void *run_thread(void *context)
{
	struct db_rtu_port *port = context;
	char name[16]; /* what top -H and ps show; the kernel keeps 15 characters */

	snprintf(name, sizeof(name), "%s", port->config.name);
	pthread_setname_np(pthread_self(), name);
	/* The default slack of 50 us is a part of the silences at high baud rates. */
	prctl(PR_SET_TIMERSLACK, 1000UL, 0UL, 0UL, 0UL);
	while (!atomic_load(&port->ending)) {
		bool readable;
		bool lost;
		int error = EIO;
		db_time now;

		if (!port->serial && atomic_load(&port->begun)) {
			const struct db_bus_config config = db_serial_port_of_line(&port->config);
			int failure = db_serial_open(&config, &port->serial);

			if (failure != 0)
				port->serial = NULL;
			port->character = db_serial_wire_time(&config, 1);
			port->silence = db_rtu_silence(port->character);
			port->awaited = 0;
			port->echo = (struct db_rtu_echo){ 0 };
			db_rtu_burst_clear(&port->burst);
			note_state(port, -failure);
		}
		wait_for_work(port, &readable, &lost);
		if (!port->serial)
			continue;
		if (((readable || lost) && !receive_bytes(port, lost, &error)) ||
		    !send_answer(port, &error)) {
			close_port(port, error);
			continue;
		}
		now = db_clock_now();
		if (port->burst.used > 0 && !readable && now - port->burst.last >= port->silence)
			end_burst(port, now - port->burst.last < PATIENCE, true);
	}
	close_port(port, 0);
	free_port(port);
	return NULL;
}

/* --- the network thread ----------------------------------------------------------------------- */

int db_rtu_port_new(const struct db_rtu_config *config, struct db_rtu_port **port)
{
	struct db_rtu_port *made = calloc(1, sizeof(*made));
	pthread_attr_t attributes;
	pthread_t thread;
	sigset_t all;
	sigset_t before;
	int error = -ENOMEM;

	if (!made)
		return -ENOMEM;
	made->config = *config;
	made->config.role_name = NULL;
	made->config.role = NULL;
	made->config.source_file = NULL;
	made->config.name = strdup(config->name);
	made->config.device = strdup(config->device);
	made->wake_fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
	made->notify_fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
	pthread_mutex_init(&made->lock, NULL);
	if (made->wake_fd < 0 || made->notify_fd < 0)
		error = -errno;
	else if (made->config.name && made->config.device)
		error = -pthread_attr_init(&attributes);
	if (error == 0) {
		(void)pthread_attr_setstacksize(&attributes, STACK_SIZE);
		(void)pthread_attr_setdetachstate(&attributes, PTHREAD_CREATE_DETACHED);
		/* Signals are the network thread's. */
		sigfillset(&all);
		pthread_sigmask(SIG_SETMASK, &all, &before);
		error = -pthread_create(&thread, &attributes, run_thread, made);
		pthread_sigmask(SIG_SETMASK, &before, NULL);
		pthread_attr_destroy(&attributes);
	}
	if (error != 0) {
		free_port(made);
		return error;
	}
	*port = made;
	return 0;
}

void db_rtu_port_begin(struct db_rtu_port *port)
{
	atomic_store(&port->begun, true);
	signal_fd(port->wake_fd);
}

int db_rtu_port_fd(const struct db_rtu_port *port)
{
	return port->notify_fd;
}

void db_rtu_port_read(struct db_rtu_port *port, struct db_rtu_figures *figures)
{
	pthread_mutex_lock(&port->lock);
	*figures = port->figures;
	pthread_mutex_unlock(&port->lock);
}

bool db_rtu_port_take(struct db_rtu_port *port, struct db_rtu_frame *frame)
{
	bool found = false;

	/* Cleared first: what comes from here on raises it again. */
	clear_fd(port->notify_fd);
	pthread_mutex_lock(&port->lock);
	while (!found && port->count > 0) {
		*frame = port->frames[port->first];
		port->first = (port->first + 1) % FRAMES;
		port->count--;
		found = frame->length > 0;
	}
	pthread_mutex_unlock(&port->lock);
	return found;
}

void db_rtu_port_answer(struct db_rtu_port *port, uint32_t number, const uint8_t *bytes,
                        size_t length)
{
	pthread_mutex_lock(&port->lock);
	port->answer_number = number;
	port->answer_length = (uint16_t)length;
	memcpy(port->answer, bytes, length);
	pthread_mutex_unlock(&port->lock);
	signal_fd(port->wake_fd);
}

void db_rtu_port_end(struct db_rtu_port *port)
{
	if (!port)
		return;
	atomic_store(&port->ending, true);
	signal_fd(port->wake_fd);
}
