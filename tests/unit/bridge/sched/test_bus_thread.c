/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The thread of a bus, in real time: commands and results, its end, added and removed drives,
 * scans, the thread's own settings. A thread that plays the drives answers at the other end of a
 * socket.
 */
#include "drivebridge/bus.h"
#include "drivebridge/clock.h"
#include "drivebridge/scan.h"
#include "fakes/family.h"
#include "log/log_private.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define DRIVES 4
#define PATIENCE (20 * DB_NS_PER_S)
#define NAME "a bus with a long name"

/* --- the drives' end -------------------------------------------------------------------------- */

static struct wire {
	int ends[2];
	pthread_t thread;
	atomic_bool silent;
	atomic_uint received[FAKE_KINDS];
} wire;

static void *play_drives(void *context)
{
	struct fake_frame frame;
	float speed[DRIVES + 1] = { 0.0f };

	(void)context;
	while (recv(wire.ends[1], &frame, sizeof frame, MSG_WAITALL) == sizeof frame) {
		atomic_fetch_add(&wire.received[frame.kind], 1);
		if (frame.address > DRIVES || atomic_load(&wire.silent))
			continue;
		if (frame.kind == FAKE_COMMAND)
			speed[frame.address] = 1.0f;
		else if (frame.kind == FAKE_STOP)
			speed[frame.address] = 0.0f;
		frame.speed = speed[frame.address];
		(void)!send(wire.ends[1], &frame, sizeof frame, MSG_NOSIGNAL);
	}
	return NULL;
}

static int wire_open(const struct db_bus_config *bus, const struct db_can_filter *filters,
                     size_t filter_count, db_time now, struct db_port **port)
{
	(void)bus;
	(void)filters;
	(void)filter_count;
	(void)now;
	if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, wire.ends) != 0 ||
	    pthread_create(&wire.thread, NULL, play_drives, NULL) != 0)
		return -EIO;
	*port = (struct db_port *)&wire;
	return 0;
}

static int wire_fd(const struct db_port *port)
{
	return ((const struct wire *)port)->ends[0];
}

static void wire_close(struct db_port *port)
{
	if (!port)
		return;
	shutdown(wire.ends[0], SHUT_RDWR);
	pthread_join(wire.thread, NULL);
	close(wire.ends[0]);
	close(wire.ends[1]);
}

static ssize_t wire_read(struct db_port *port, void *bytes, size_t size, db_time now)
{
	ssize_t count = recv(wire_fd(port), bytes, size, MSG_DONTWAIT);

	(void)now;
	return count >= 0 ? count : errno == EAGAIN ? 0 : -errno;
}

static ssize_t wire_write(struct db_port *port, const void *bytes, size_t length, db_time now)
{
	ssize_t count = send(wire_fd(port), bytes, length, MSG_DONTWAIT | MSG_NOSIGNAL);

	(void)now;
	return count >= 0 ? count : -errno;
}

static db_time wire_time(const struct db_bus_config *bus, const uint8_t *request,
                         size_t request_length, size_t answer_length)
{
	(void)bus;
	(void)request;
	return (db_time)(request_length + answer_length) * DB_NS_PER_US;
}

static const struct db_transport transport = {
	.name = "wire",
	.medium = DB_MEDIUM_SERIAL,
	.open = wire_open,
	.close = wire_close,
	.fd = wire_fd,
	.read = wire_read,
	.write = wire_write,
	.wire_time = wire_time,
};

/* This family can only be asked whether a drive answers at an address. */
static bool inquire(const struct db_bus_config *bus, const struct db_inquiry *inquiry,
                    struct db_exchange *exchange)
{
	(void)bus;
	if (inquiry->kind != DB_INQUIRY_THERE)
		return false;
	fake_write_inquiry(inquiry, exchange);
	return true;
}

static enum db_recognised recognise(const struct db_bus_config *bus,
                                    const struct db_inquiry *inquiry, const uint8_t *bytes,
                                    size_t length, struct db_inquired *said)
{
	struct fake_frame frame = fake_frame_at(bytes, length);

	(void)bus;
	(void)said;
	return frame.kind == FAKE_INQUIRY && frame.address == inquiry->address ?
	               DB_RECOGNISED_ANSWER :
	               DB_RECOGNISED_NOTHING;
}

/* --- the bridge's end ------------------------------------------------------------------------- */

struct world {
	struct db_driver driver;
	struct db_bus_config config;
	double poll_exchanges; /* the bus's options */
	struct db_drive_config drives[DRIVES];
	struct db_bus_drive list[DRIVES];
	struct db_log *log;
	struct db_bus *bus;
	atomic_uint told[DB_EVENT_COUNT];
};

static void take_line(void *context, const struct db_log_record *record)
{
	atomic_fetch_add(&((struct world *)context)->told[record->event], 1);
}

/* The bus is not made yet: the test may still change its configuration. */
static struct world *new_world(void)
{
	struct world *world = calloc(1, sizeof *world);

	assert_non_null(world);
	memset(&wire, 0, sizeof wire);
	world->driver = fake_family;
	world->driver.address_min = 1;
	world->driver.address_max = 9;
	world->driver.inquire = inquire;
	world->driver.recognise = recognise;
	world->config = (struct db_bus_config){
		.name = (char *)NAME,
		.driver = &world->driver,
		.transport = &transport,
		.options = &world->poll_exchanges,
		.device = (char *)"wire",
		.baud = 115200,
		.cycle_ms = 10,
		.drive_latency_ms = 100,
		.retries = 2,
		.queue = 8,
		.log = DB_LOG_INFO,
	};
	for (size_t i = 0; i < DRIVES; i++) {
		world->drives[i] = (struct db_drive_config){
			.name = (char *)"d",
			.address = (unsigned)i + 1,
			.on_exit = DB_ON_LOSS_STOP,
			.stop_reaction_ms = 1000,
			.counts_per_unit = 1.0,
			.min_position = NAN,
			.max_position = NAN,
		};
		world->list[i] = (struct db_bus_drive){ (uint16_t)i, &world->drives[i],
			                                db_axis_new(0) };
		assert_non_null(world->list[i].axis);
	}
	assert_int_equal(db_log_new_to(take_line, world, &world->log), 0);
	return world;
}

/* Makes the bus with the first `drives` of the drives. */
static void make_bus(struct world *world, size_t drives)
{
	assert_int_equal(db_bus_new(&world->config, world->list, drives, world->log, &world->bus),
	                 0);
}

static void close_world(struct world *world)
{
	db_bus_free(world->bus);
	db_log_free(world->log);
	for (size_t i = 0; i < DRIVES; i++)
		db_axis_free(world->list[i].axis);
	free(world);
}

static struct db_snapshot snapshot(const struct world *world, size_t drive)
{
	struct db_snapshot snapshot;

	db_axis_read(world->list[drive].axis, &snapshot);
	return snapshot;
}

static bool is_online(const struct world *world, size_t drive)
{
	return snapshot(world, drive).feedback.status & DB_STATUS_ONLINE;
}

static bool has_told(struct world *world, enum db_event event)
{
	return atomic_load(&world->told[event]) > 0;
}

#define WAIT_UNTIL(condition)                                   \
	for (db_time since = db_clock_now(); !(condition);) {   \
		assert_true(db_clock_now() - since < PATIENCE); \
		(void)poll(NULL, 0, 1);                         \
	}

static struct world *open_world_with(unsigned cycle_ms)
{
	struct world *world = new_world();

	world->config.cycle_ms = cycle_ms;
	make_bus(world, 1);
	assert_int_equal(db_bus_start(world->bus), 0);
	WAIT_UNTIL(is_online(world, 0));
	return world;
}

static struct world *open_world(void)
{
	return open_world_with(10);
}

static bool has_news(const struct world *world)
{
	struct pollfd news = { .fd = db_bus_completion_fd(world->bus), .events = POLLIN };

	return poll(&news, 1, 0) > 0;
}

/* Waits as the network thread does: until the bus signals that there is something to fetch. */
static void wait_for_news(const struct world *world)
{
	struct pollfd news = { .fd = db_bus_completion_fd(world->bus), .events = POLLIN };

	assert_int_equal(poll(&news, 1, (int)(PATIENCE / MS)), 1);
}

static void command(struct world *world, enum db_command command)
{
	const struct db_request request = { .ticket = 7, .command = command };
	struct db_request *ended = NULL;

	assert_non_null(db_bus_submit(world->bus, &request));
	while (!ended) {
		wait_for_news(world);
		ended = db_bus_completion(world->bus);
	}
	assert_int_equal(ended->ticket, 7);
	assert_int_equal(ended->result, DB_RESULT_OK);
	db_bus_release(ended);
}

static unsigned count_open_files(void)
{
	DIR *folder = opendir("/proc/self/fd");
	unsigned count = 0;

	assert_non_null(folder);
	while (readdir(folder))
		count++;
	closedir(folder);
	return count;
}

/* --- readings and results --------------------------------------------------------------------- */

static void a_drive_is_read_and_commanded(void **state)
{
	struct world *world = open_world();
	struct db_bus_stats stats;
	int64_t wall_us = db_clock_read(CLOCK_REALTIME) / DB_NS_PER_US;
	int64_t off;

	(void)state;
	command(world, DB_CMD_ENABLE);
	assert_int_equal(atomic_load(&wire.received[FAKE_COMMAND]), 1);
	WAIT_UNTIL(snapshot(world, 0).feedback.status & DB_STATUS_MOVING);
	off = (int64_t)snapshot(world, 0).feedback.taken_wall_us - wall_us;
	assert_true(off > -2000000 && off < PATIENCE / DB_NS_PER_US);
	db_bus_read_stats(world->bus, &stats);
	assert_true(stats.up && stats.port.up);
	assert_int_equal(stats.opens, 1);
	assert_int_equal(stats.online, 1);
	assert_true(stats.transactions > 0);
	WAIT_UNTIL(has_told(world, DB_EVENT_BUS_UP) && has_told(world, DB_EVENT_DRIVE_ONLINE));
	/* Neither a processor nor a priority is configured, so the kernel can refuse neither. */
	assert_false(has_told(world, DB_EVENT_CPUS_REFUSED));
	assert_false(has_told(world, DB_EVENT_PRIORITY_REFUSED));
	close_world(world);
}

/* True if the trace has a record of this event. */
static bool is_traced(const struct world *world, enum db_event event)
{
	struct db_trace_place place = { .at = 0 };
	char drive[DB_TRACE_NAME_MAX + 1];
	struct db_trace_record record;
	uint32_t missed;

	while (db_trace_read(db_bus_trace(world->bus), &place, &record, &missed)) {
		if (record.kind == DB_TRACE_EVENT && db_trace_event_of(&record, drive) == event)
			return true;
	}
	return false;
}

static void events_are_in_the_log_and_in_the_trace(void **state)
{
	static const enum db_event events[] = { DB_EVENT_BUS_UP, DB_EVENT_DRIVE_ONLINE,
		                                DB_EVENT_DRIVE_LOST };
	struct world *world = open_world();
	uint32_t beats;

	(void)state;
	atomic_store(&wire.silent, true);
	WAIT_UNTIL(!is_online(world, 0));
	/* The lost drive is signalled to the network thread. */
	wait_for_news(world);
	while (!is_traced(world, DB_EVENT_DRIVE_LOST))
		wait_for_news(world);
	/* There is one signal only: several turns of the bus thread later there is no other. */
	assert_null(db_bus_completion(world->bus));
	beats = db_bus_heartbeat(world->bus);
	WAIT_UNTIL(db_bus_heartbeat(world->bus) - beats > 3);
	assert_false(has_news(world));
	for (size_t i = 0; i < sizeof events / sizeof events[0]; i++)
		WAIT_UNTIL(has_told(world, events[i]) && is_traced(world, events[i]));
	close_world(world);
}

/* A bus without drives has nothing to do: its thread still turns, but only a few times a second. */
static void the_heartbeat_of_an_idle_bus_goes_on(void **state)
{
	const struct db_request nobody = { .drive = 99, .command = DB_CMD_ENABLE };
	struct world *world = new_world();
	db_time begun;
	uint32_t beats;

	(void)state;
	world->config.cycle_ms = 10000;
	assert_int_equal(db_bus_new(&world->config, NULL, 0, world->log, &world->bus), 0);
	assert_int_equal(db_bus_start(world->bus), 0);
	WAIT_UNTIL(db_bus_heartbeat(world->bus) > 0);
	/* A request for an unknown drive wakes the thread, which then must not keep turning. */
	assert_non_null(db_bus_submit(world->bus, &nobody));
	wait_for_news(world);
	db_bus_release(db_bus_completion(world->bus));
	begun = db_clock_now();
	beats = db_bus_heartbeat(world->bus);
	WAIT_UNTIL(db_bus_heartbeat(world->bus) - beats >= 3);
	assert_true(db_clock_now() - begun > 200 * MS);
	close_world(world);
}

/* Reading the completions and the figures of the bus does not block. */
static void a_bus_that_was_not_started_has_only_figures(void **state)
{
	struct world *world = new_world();
	struct db_bus_stats stats;

	(void)state;
	make_bus(world, 1);
	assert_false(has_news(world));
	assert_null(db_bus_completion(world->bus));
	assert_true(fcntl(db_bus_completion_fd(world->bus), F_GETFD) & FD_CLOEXEC);
	db_bus_read_stats(world->bus, &stats);
	assert_int_equal(stats.period_us, 10000);
	assert_false(stats.up);
	close_world(world);
}

/* The bus needs two file descriptors: with none or one left it reports EMFILE. */
static void without_file_descriptors_no_bus_is_made(void **state)
{
	struct world *world = new_world();
	struct rlimit before;
	struct rlimit limit;
	int next = dup(STDIN_FILENO);

	(void)state;
	assert_true(next >= 0);
	close(next);
	assert_int_equal(getrlimit(RLIMIT_NOFILE, &before), 0);
	for (int left = 0; left < 2; left++) {
		int result;

		limit = (struct rlimit){ (rlim_t)(next + left), before.rlim_max };
		assert_int_equal(setrlimit(RLIMIT_NOFILE, &limit), 0);
		result = db_bus_new(&world->config, world->list, 1, world->log, &world->bus);
		assert_int_equal(setrlimit(RLIMIT_NOFILE, &before), 0);
		assert_int_equal(result, -EMFILE);
	}
	close_world(world);
}

/* --- the end of the bus ----------------------------------------------------------------------- */

static void the_end_stops_the_drives_and_closes_all_files(void **state)
{
	unsigned files = 0;

	(void)state;
	/* The first bus may open files that the process keeps; the second one must leave no
	 * more. */
	for (unsigned i = 0; i < 2; i++) {
		struct world *world = open_world();

		command(world, DB_CMD_MOVE_VELOCITY);
		assert_false(db_bus_has_ended(world->bus));
		db_bus_ask_end(world->bus);
		while (!db_bus_has_ended(world->bus)) {
			wait_for_news(world);
			(void)db_bus_completion(world->bus);
		}
		assert_true(atomic_load(&wire.received[FAKE_STOP]) > 0);
		assert_false(has_told(world, DB_EVENT_DRIVE_UNCONFIRMED));
		close_world(world);
		if (i > 0)
			assert_int_equal(count_open_files(), files);
		files = count_open_files();
	}
}

static void a_drive_that_does_not_confirm_its_last_stop_is_logged(void **state)
{
	struct world *world = open_world();
	db_time begun;

	(void)state;
	command(world, DB_CMD_MOVE_VELOCITY);
	atomic_store(&wire.silent, true);
	begun = db_clock_now();
	db_bus_stop(world->bus);
	assert_true(db_bus_has_ended(world->bus));
	assert_true(db_clock_now() - begun < PATIENCE);
	WAIT_UNTIL(has_told(world, DB_EVENT_DRIVE_UNCONFIRMED));
	close_world(world);
}

/* --- changes ---------------------------------------------------------------------------------- */

static void drives_come_and_go(void **state)
{
	struct world *world = open_world();

	(void)state;
	for (unsigned i = 0; i < 3; i++) {
		const uint16_t leaving = (uint16_t)(i % 2);
		struct db_change *change = NULL;
		struct db_change *changed = NULL;

		assert_int_equal(db_bus_change_new(world->bus, &leaving, 1,
		                                   &world->list[1 - leaving], 1, &change),
		                 0);
		db_bus_change(world->bus, change);
		while (!changed) {
			wait_for_news(world);
			changed = db_bus_take_changed(world->bus);
			assert_null(db_bus_completion(world->bus));
		}
		assert_ptr_equal(changed, change);
		assert_null(db_bus_take_changed(world->bus));
		db_bus_change_free(changed);
		WAIT_UNTIL(is_online(world, 1 - leaving));
	}
	close_world(world);
}

static void one_more_drive_comes_to_several(void **state)
{
	struct world *world = new_world();
	struct db_change *change = NULL;

	(void)state;
	make_bus(world, DRIVES - 1);
	assert_int_equal(db_bus_start(world->bus), 0);
	WAIT_UNTIL(is_online(world, 0) && is_online(world, DRIVES - 2));
	assert_int_equal(
		db_bus_change_new(world->bus, NULL, 0, &world->list[DRIVES - 1], 1, &change), 0);
	db_bus_change(world->bus, change);
	for (size_t i = 0; i < DRIVES; i++)
		WAIT_UNTIL(is_online(world, i));
	/* The change is not fetched: it is freed with the bus. */
	close_world(world);
}

/* A change that was never handed over to the bus is freed by its maker. */
static void a_change_that_was_not_carried_out_is_freed_with_the_bus(void **state)
{
	struct world *world = new_world();
	struct db_change *change = NULL;

	(void)state;
	make_bus(world, 1);
	assert_int_equal(db_bus_change_new(world->bus, NULL, 0, &world->list[1], 1, &change), 0);
	db_bus_change_free(change);
	assert_int_equal(db_bus_change_new(world->bus, NULL, 0, &world->list[1], 1, &change), 0);
	db_bus_change(world->bus, change);
	close_world(world);
}

/* --- scans ------------------------------------------------------------------------------------ */

/* Milliseconds: a cycle long enough for the questions of a scan, on a busy machine, too. */
#define ROOMY 1000

static int try_plan(enum db_line line, struct db_scan_plan plan)
{
	struct world *world = new_world();
	uint32_t number;
	int result;

	world->config.line = line;
	make_bus(world, 1);
	result = db_bus_scan(world->bus, &plan, &number);
	close_world(world);
	return result;
}

static int try_addresses(enum db_line line, unsigned first, unsigned last)
{
	return try_plan(line, (struct db_scan_plan){ .first = first, .last = last });
}

static void a_plan_has_addresses_and_speeds_that_drives_can_have(void **state)
{
	const struct db_scan_plan many = {
		.first = 1, .last = 1, .aside = true, .speed_count = DB_SCAN_SPEEDS_MAX
	};
	struct db_scan_plan plan = many;

	(void)state;
	assert_int_equal(try_addresses(DB_LINE_RS485, 1, 9), 0);
	assert_int_equal(try_addresses(DB_LINE_RS485, 0, 9), -EINVAL);
	assert_int_equal(try_addresses(DB_LINE_RS485, 1, 10), -EINVAL);
	assert_int_equal(try_addresses(DB_LINE_RS485, 5, 5), 0);
	assert_int_equal(try_addresses(DB_LINE_RS485, 5, 4), -EINVAL);
	/* An RS-232 line has one drive, which has no address: only 0 is valid. */
	assert_int_equal(try_addresses(DB_LINE_RS232, 0, 0), 0);
	assert_int_equal(try_addresses(DB_LINE_RS232, 0, 1), -EINVAL);
	assert_int_equal(try_plan(DB_LINE_RS485, many), 0);
	plan.speed_count++;
	assert_int_equal(try_plan(DB_LINE_RS485, plan), -EINVAL);
	plan.speed_count = 0;
	assert_int_equal(try_plan(DB_LINE_RS485, plan), -EINVAL);
}

static struct db_scan_progress progress(const struct world *world, uint32_t number)
{
	struct db_scan_progress progress;

	assert_true(db_bus_scan_read(world->bus, number, &progress));
	return progress;
}

static void one_scan_at_a_time_is_carried_out(void **state)
{
	const struct db_scan_plan plan = { .first = 1, .last = DRIVES + 1 };
	struct world *world = open_world_with(ROOMY);
	struct db_scan_progress read;
	uint32_t first;
	uint32_t second;

	(void)state;
	assert_false(db_bus_scan_read(world->bus, 1, &read));
	assert_int_equal(db_bus_scan(world->bus, &plan, &first), 0);
	WAIT_UNTIL(progress(world, first).end != DB_SCAN_RUNS);
	assert_int_equal(progress(world, first).end, DB_SCAN_DONE);
	assert_int_equal(progress(world, first).total, DRIVES + 1);
	/* Address 1 is configured, 2 to DRIVES answer the scan, and the last address is silent. */
	assert_int_equal(progress(world, first).asked, DRIVES + 1);
	assert_int_equal(db_bus_scan_find(world->bus, progress(world, first).finds - 1)->address,
	                 DRIVES);
	WAIT_UNTIL(db_bus_scan(world->bus, &plan, &second) != -EBUSY);
	assert_false(db_bus_scan_read(world->bus, first, &read));
	WAIT_UNTIL(progress(world, second).end == DB_SCAN_DONE);
	close_world(world);
}

static void a_scan_is_cancelled_only_by_its_own_number(void **state)
{
	const struct db_scan_plan plan = { .first = 1, .last = 9 };

	(void)state;
	for (unsigned i = 0; i < 2; i++) {
		struct world *world = new_world();
		uint32_t number;

		world->config.cycle_ms = ROOMY;
		make_bus(world, 1);
		db_bus_scan_cancel(world->bus, 1);
		assert_int_equal(db_bus_scan(world->bus, &plan, &number), 0);
		assert_int_equal(db_bus_scan(world->bus, &plan, &number), -EBUSY);
		db_bus_scan_cancel(world->bus, number + i);
		assert_int_equal(db_bus_start(world->bus), 0);
		WAIT_UNTIL(progress(world, number).end != DB_SCAN_RUNS);
		assert_int_equal(progress(world, number).end,
		                 i == 0 ? DB_SCAN_CANCELLED : DB_SCAN_DONE);
		close_world(world);
	}
}

static void the_end_of_the_bus_cancels_its_scan(void **state)
{
	const struct db_scan_plan plan = { .first = 3, .last = 9 };
	struct world *world = open_world_with(ROOMY);
	uint32_t number;

	(void)state;
	assert_int_equal(db_bus_scan(world->bus, &plan, &number), 0);
	db_bus_stop(world->bus);
	assert_int_equal(progress(world, number).end, DB_SCAN_CANCELLED);
	close_world(world);
}

/* --- the thread itself ------------------------------------------------------------------------ */

/* The kernel's number of the thread whose name begins like this, or 0. */
static pid_t find_thread(const char *wanted)
{
	DIR *folder = opendir("/proc/self/task");
	struct dirent *entry;
	pid_t found = 0;

	assert_non_null(folder);
	while (found == 0 && (entry = readdir(folder)) != NULL) {
		char path[512];
		char name[32] = "";
		FILE *file;

		(void)snprintf(path, sizeof path, "/proc/self/task/%s/comm", entry->d_name);
		file = fopen(path, "r");
		if (file && fgets(name, sizeof name, file) &&
		    strncmp(name, wanted, strlen(wanted)) == 0)
			found = (pid_t)atoi(entry->d_name);
		if (file)
			fclose(file);
	}
	closedir(folder);
	return found;
}

static void the_thread_has_the_name_and_the_processor_of_its_bus(void **state)
{
	struct world *world = new_world();
	cpu_set_t set;
	size_t cpu = 63;

	(void)state;
	assert_int_equal(sched_getaffinity(0, sizeof set, &set), 0);
	while (!CPU_ISSET(cpu, &set))
		cpu--;
	assert_true(cpu < 64);
	world->config.cpus = UINT64_C(1) << cpu;
	make_bus(world, 1);
	assert_int_equal(db_bus_start(world->bus), 0);
	WAIT_UNTIL(is_online(world, 0));
	assert_int_equal(sched_getaffinity(find_thread("a bus with a lo"), sizeof set, &set), 0);
	assert_int_equal(CPU_COUNT(&set), 1);
	assert_true(CPU_ISSET(cpu, &set));
	assert_false(has_told(world, DB_EVENT_CPUS_REFUSED));
	close_world(world);
}

static void a_processor_that_does_not_exist_is_logged(void **state)
{
	struct world *world = new_world();

	(void)state;
	world->config.cpus = UINT64_C(1) << 63;
	make_bus(world, 1);
	assert_int_equal(db_bus_start(world->bus), 0);
	WAIT_UNTIL(has_told(world, DB_EVENT_CPUS_REFUSED));
	WAIT_UNTIL(is_online(world, 0));
	close_world(world);
}

static void a_priority_that_does_not_exist_is_logged(void **state)
{
	struct world *world = new_world();

	(void)state;
	world->config.priority = 1000;
	make_bus(world, 1);
	assert_int_equal(db_bus_start(world->bus), 0);
	WAIT_UNTIL(has_told(world, DB_EVENT_PRIORITY_REFUSED));
	WAIT_UNTIL(is_online(world, 0));
	close_world(world);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_drive_is_read_and_commanded),
		cmocka_unit_test(events_are_in_the_log_and_in_the_trace),
		cmocka_unit_test(the_heartbeat_of_an_idle_bus_goes_on),
		cmocka_unit_test(a_bus_that_was_not_started_has_only_figures),
		cmocka_unit_test(without_file_descriptors_no_bus_is_made),
		cmocka_unit_test(the_end_stops_the_drives_and_closes_all_files),
		cmocka_unit_test(a_drive_that_does_not_confirm_its_last_stop_is_logged),
		cmocka_unit_test(drives_come_and_go),
		cmocka_unit_test(one_more_drive_comes_to_several),
		cmocka_unit_test(a_change_that_was_not_carried_out_is_freed_with_the_bus),
		cmocka_unit_test(a_plan_has_addresses_and_speeds_that_drives_can_have),
		cmocka_unit_test(one_scan_at_a_time_is_carried_out),
		cmocka_unit_test(a_scan_is_cancelled_only_by_its_own_number),
		cmocka_unit_test(the_end_of_the_bus_cancels_its_scan),
		cmocka_unit_test(the_thread_has_the_name_and_the_processor_of_its_bus),
		cmocka_unit_test(a_processor_that_does_not_exist_is_logged),
		cmocka_unit_test(a_priority_that_does_not_exist_is_logged),
	};

	return cmocka_run_group_tests_name("the thread of a bus", tests, NULL, NULL);
}
