/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The line of a bus: when the filters of a CAN port are open, a port that is lost, busy, full or
 * broken, and scans that have the line to themselves. The real line and engine with a port that
 * records what is done to it, in made-up time.
 */
#include "sched/bus_line.h"

#include "codec/vsmd_can.h"
#include "drivebridge/process.h"
#include "drivebridge/trace.h"
#include "drivebridge/transport.h"
#include "fakes/bus.h"
#include "log/log_private.h"
#include "sched/scan.h"
#include "sched/sched_private.h"

#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define ADDRESS 7
#define STATUS_REG 2

struct story {
	struct fake_bus *bus;
	struct bus_line line;
	struct db_log_source log;
	bool answers;      /* as documented */
	bool to_others;    /* ... but to another host, which the filters keep away */
	bool open;         /* the filters are */
	unsigned changes;  /* of them */
	unsigned asked;    /* questions */
	unsigned unheard;  /* of these, while the filters were not open */
	unsigned told;     /* that it answers, but not as documented */
	db_time open_time; /* so long they were */
	db_time looked;
	unsigned opens;     /* of the port ... */
	unsigned closes;    /* ... and */
	unsigned opened[8]; /* with this speed */
	size_t filtered[8]; /* and so many filters */
	int refuses;        /* it cannot be opened, because of this error */
	struct scan *scan;
	size_t arrives; /* bytes that can be read: 0s */
	int breaks;     /* what reading and writing fail with */
	struct db_port_health health;
	size_t takes; /* bytes at a time */
	uint8_t taken[64];
	size_t taken_length;
	size_t gathered
		[16]; /* so many bytes wake the thread up: in the order in which this was set */
	size_t gather_count;
	bool cannot_gather;
};

/* The transport's functions know no more than their port. */
static struct story *told_of;

static int open_port(const struct db_bus_config *bus, const struct db_can_filter *filters,
                     size_t filter_count, db_time now, struct db_port **port)
{
	(void)filters;
	(void)now;
	assert_true(told_of->opens < sizeof(told_of->opened) / sizeof(told_of->opened[0]));
	told_of->opened[told_of->opens] = bus->bitrate;
	told_of->filtered[told_of->opens++] = filter_count;
	if (told_of->refuses != 0)
		return -told_of->refuses;
	told_of->open = filter_count == 0;
	*port = (struct db_port *)told_of;
	return 0;
}

static void close_port(struct db_port *port)
{
	if (port)
		((struct story *)port)->closes++;
}

static void pass(struct db_port *port, bool everything)
{
	struct story *story = (struct story *)port;

	story->open = everything;
	story->changes++;
}

static db_time take_no_time(const struct db_bus_config *bus, const uint8_t *request,
                            size_t request_length, size_t answer_length)
{
	(void)bus;
	(void)request;
	(void)request_length;
	(void)answer_length;
	return 100 * DB_NS_PER_US;
}

static struct db_transport transport; /* as socketcan, but for what is above */

static db_time send(void *context, const uint8_t *bytes, size_t length)
{
	struct story *story = context;
	struct vsmd_can_style style = { .extended = true, .host = story->to_others ? 5 : 1 };
	uint32_t values[VSMD_CAN_READ_MAX] = { 0 };
	struct db_can_frame frames[VSMD_CAN_READ_MAX];
	struct vsmd_can_message message;
	int count;

	memcpy(frames, bytes + length - sizeof frames[0], sizeof frames[0]);
	story->asked++;
	story->unheard += !story->open;
	if (!story->answers && !(story->to_others && story->open))
		return story->bus->now;
	assert_int_equal(vsmd_can_decode(&style, frames, &message), VSMD_OK);
	/* It has its power, and stands. */
	if (message.command.code == VSMD_CAN_READ_STATUS && message.command.first <= STATUS_REG &&
	    STATUS_REG < message.command.first + message.command.count)
		values[STATUS_REG - message.command.first] = VSMD_ST_PWR | VSMD_ST_STP;
	count = vsmd_can_encode_answer(
		&style, ADDRESS,
		message.command.code == VSMD_CAN_READ_STATUS ? VSMD_CAN_STATUS_REPLY :
							       VSMD_CAN_DATA_REPLY,
		message.command.first, values, message.command.count, frames, VSMD_CAN_READ_MAX);
	assert_true(count > 0);
	fake_answer_after(story->bus, 300 * DB_NS_PER_US, frames, (size_t)count * sizeof frames[0]);
	return story->bus->now;
}

static void note_heard(void *context, const struct db_drive_config *drive,
                       const struct db_unusable *heard)
{
	(void)drive;
	assert_true(heard->count > 0);
	((struct story *)context)->told++;
}

static const struct db_engine_ops ops = { .send = send, .on_unusable = note_heard };

static db_time look_often(void *context)
{
	return ((const struct story *)context)->bus->now + MS;
}

static void run_line(void *context)
{
	struct story *story = context;

	story->open_time += story->open ? story->bus->now - story->looked : 0;
	story->looked = story->bus->now;
	(void)bus_line_run(&story->line, story->bus->now);
}

static void begin(struct story *story)
{
	const struct db_driver *driver = db_driver_find("vsmd-can");

	told_of = story;
	transport = db_transport_socketcan;
	transport.open = open_port;
	transport.close = close_port;
	transport.pass = pass;
	transport.run = NULL;
	transport.health = NULL;
	transport.gather = NULL;
	transport.wire_time = take_no_time;
	story->bus = fake_bus_new(driver, 1);
	story->bus->config.transport = &transport;
	story->bus->config.bitrate = 500000;
	story->bus->config.interface = "can0";
	fake_option(story->bus, "host-id", 1);
	story->bus->drives[0].address = ADDRESS;
	story->bus->context = story;
	story->bus->next = look_often;
	story->bus->happen = run_line;
	fake_bus_open(story->bus, 1, &ops);
	story->line = (struct bus_line){
		.config = &story->bus->config,
		.transport = &transport,
		.log = &story->log,
		.engine = story->bus->engine,
	};
	story->looked = story->bus->now;
	run_line(story);
}

static void end(struct story *story)
{
	bus_line_close(&story->line);
	fake_bus_free(story->bus);
}

static void a_drive_that_answers_leaves_them_closed(void **state)
{
	struct story story = { .answers = true };

	(void)state;
	begin(&story);
	assert_true(story.filtered[0] > 0);
	fake_pass(story.bus, 5000 * MS);
	assert_true(story.asked > 0);
	assert_int_equal(story.changes, 0);
	end(&story);
}

/* It is listened to while it is asked, and for no longer. */
static void they_are_open_while_a_silent_drive_is_asked(void **state)
{
	struct story story = { .to_others = false };
	unsigned asked;

	(void)state;
	begin(&story);
	fake_pass(story.bus, 10000 * MS);
	asked = story.asked;
	story.unheard = 0;
	story.open_time = 0;
	fake_pass(story.bus, 20000 * MS);
	assert_true(story.asked > asked + 5);
	assert_int_equal(story.unheard, 0);
	assert_true(story.open_time < 20000 * MS / 10);
	assert_false(story.open);
	assert_int_equal(story.told, 0);
	end(&story);
}

static void answers_to_another_host_are_named(void **state)
{
	struct story story = { .to_others = true };

	(void)state;
	begin(&story);
	fake_pass(story.bus, 10000 * MS);
	assert_false(fake_is_online(story.bus, 0));
	assert_int_equal(story.told, 1);
	end(&story);
}

/* --- what is told of the port ------------------------------------------------------------------- */

#define LINES 8

struct told {
	size_t count;
	char lines[LINES][256];
};

static void take_line(void *context, const struct db_log_record *record)
{
	struct told *told = context;

	assert_true(told->count < LINES);
	(void)snprintf(told->lines[told->count++], sizeof(told->lines[0]), "%s", record->text);
}

static pid_t this_process(const struct db_bus_config *bus)
{
	(void)bus;
	return getpid();
}

static ssize_t read_nothing(struct db_port *port, void *bytes, size_t size, db_time now)
{
	(void)port;
	(void)bytes;
	(void)size;
	(void)now;
	return 0;
}

/* As begin(), with a log; end_told() ends it. */
static void begin_told(struct story *story, struct told *told)
{
	story->log.level = DB_LOG_INFO;
	assert_int_equal(db_log_new_to(take_line, told, &story->log.log), 0);
	begin(story);
	transport.holder = this_process;
	transport.read = read_nothing;
}

static void end_told(struct story *story)
{
	end(story);
	db_log_free(story->log.log);
}

static enum db_event event_behind(const struct story *story, struct db_trace_place *place)
{
	char drive[DB_TRACE_NAME_MAX + 1];
	struct db_trace_record record;
	uint32_t missed;

	while (db_trace_read(db_engine_trace(story->bus->engine), place, &record, &missed)) {
		if (record.kind != DB_TRACE_EVENT)
			continue;
		assert_true(record.time == story->bus->now);
		return db_trace_event_of(&record, drive);
	}
	return DB_EVENT_COUNT;
}

/* It hung up. */
static void lose_port(struct story *story)
{
	bus_line_polled(&story->line, POLLHUP, false);
	assert_true(bus_line_check(&story->line, story->bus->now));
}

/* Each reason once, and what can be done. */
static void a_port_that_cannot_be_opened_is_told_with_what_to_do(void **state)
{
	struct story story = { .answers = true };
	struct told told = { .count = 0 };
	char holder[DB_PROCESS_WORDS_MAX];
	char words[256];

	(void)state;
	begin_told(&story, &told);
	lose_port(&story);
	story.refuses = ENODEV;
	fake_pass(story.bus, 600 * MS);
	story.refuses = EBUSY;
	fake_pass(story.bus, 1600 * MS);
	assert_int_equal(fake_stats(story.bus).last_error, EBUSY);
	story.refuses = ENETDOWN;
	fake_pass(story.bus, 600 * MS);
	assert_int_equal(fake_stats(story.bus).last_error, ENETDOWN);
	story.refuses = 0;
	fake_pass(story.bus, 1000 * MS);
	assert_true(fake_is_online(story.bus, 0));
	/* The same again, as it has been up. */
	lose_port(&story);
	end_told(&story);
	db_process_words(getpid(), holder);
	assert_int_equal(told.count, 6);
	assert_string_equal(told.lines[0], "can0 is up");
	assert_string_equal(told.lines[1],
	                    "lost can0: No such device; is it plugged in, and is its name right?; "
	                    "waiting for it to come back");
	(void)snprintf(
		words, sizeof(words),
		"cannot open can0: Device or resource busy; %s has it: end that; trying again",
		holder);
	assert_string_equal(told.lines[2], words);
	assert_string_equal(
		told.lines[3],
		"cannot open can0: Network is down; the interface is down: set it up with its "
		"bit rate (systemd-networkd); trying again");
	assert_string_equal(told.lines[4], "can0 is up");
	assert_string_equal(told.lines[5], told.lines[1]);
}

static pid_t nobody(const struct db_bus_config *bus)
{
	(void)bus;
	return 0;
}

/* Also where it cannot be found out who has it. */
static void a_port_that_is_busy_names_nobody_who_is_not_known(void **state)
{
	struct story story = { .answers = true };
	struct told told = { .count = 0 };

	(void)state;
	begin_told(&story, &told);
	transport.holder = nobody;
	lose_port(&story);
	story.refuses = EBUSY;
	fake_pass(story.bus, 600 * MS);
	end_told(&story);
	assert_int_equal(told.count, 3);
	assert_string_equal(
		told.lines[2],
		"cannot open can0: Device or resource busy; another program uses it; trying again");
}

static void a_port_that_was_lost_is_closed_and_opened_again(void **state)
{
	struct story story = { .answers = true };

	(void)state;
	begin(&story);
	transport.read = read_nothing;
	fake_pass(story.bus, 1000 * MS);
	assert_false(bus_line_check(&story.line, story.bus->now));
	lose_port(&story);
	assert_int_equal(story.closes, 1);
	assert_false(fake_is_online(story.bus, 0));
	assert_false(bus_line_check(&story.line, story.bus->now));
	/* Not at once: an adapter that was pulled comes back in a while. */
	fake_pass(story.bus, 490 * MS);
	assert_int_equal(story.opens, 1);
	fake_pass(story.bus, 20 * MS);
	assert_int_equal(story.opens, 2);
	fake_pass(story.bus, 1000 * MS);
	assert_false(bus_line_check(&story.line, story.bus->now));
	assert_true(fake_is_online(story.bus, 0));
	end(&story);
}

/* The port was open again in between, so its second loss is news. */
static void a_port_that_is_lost_again_is_told_of_again(void **state)
{
	struct story story = { .answers = true };
	struct told told = { .count = 0 };
	struct pollfd poll;

	(void)state;
	begin_told(&story, &told);
	for (unsigned i = 0; i < 2; i++) {
		fake_pass(story.bus, 1000 * MS);
		lose_port(&story);
		(void)bus_line_poll(&story.line, &poll);
		assert_int_equal(poll.fd, -1);
	}
	end_told(&story);
	assert_int_equal(told.count, 4);
	assert_string_equal(told.lines[3], told.lines[1]);
}

static void the_holder_of_a_port_is_known_only_while_the_port_is_busy(void **state)
{
	struct story story = { .answers = true };

	(void)state;
	begin(&story);
	transport.holder = this_process;
	lose_port(&story);
	story.refuses = EBUSY;
	fake_pass(story.bus, 600 * MS);
	assert_true(story.line.holder[0] != '\0');
	story.refuses = ENODEV;
	fake_pass(story.bus, 600 * MS);
	assert_string_equal(story.line.holder, "");
	end(&story);
}

static void a_port_is_closed_at_the_end(void **state)
{
	struct story story = { .answers = true };

	(void)state;
	begin(&story);
	end(&story);
	assert_int_equal(story.closes, 1);
	assert_null(story.line.port);
}

static void a_family_without_filters_has_none(void **state)
{
	struct story story = { .answers = true };
	struct db_driver driver;

	(void)state;
	begin(&story);
	driver = *story.bus->config.driver;
	driver.filters = NULL;
	story.bus->config.driver = &driver;
	lose_port(&story);
	fake_pass(story.bus, 1000 * MS);
	assert_int_equal(story.opens, 2);
	assert_int_equal(story.filtered[1], 0);
	end(&story);
}

static void the_trace_has_when_the_port_came_and_went(void **state)
{
	struct story story = { .answers = true };
	struct db_trace_place place = { .at = 0 };

	(void)state;
	begin(&story);
	transport.read = read_nothing;
	assert_int_equal(event_behind(&story, &place), DB_EVENT_BUS_UP);
	assert_false(story.line.has_trouble);
	fake_pass(story.bus, 100 * MS);
	assert_int_equal(event_behind(&story, &place), DB_EVENT_COUNT);
	lose_port(&story);
	assert_int_equal(event_behind(&story, &place), DB_EVENT_BUS_LOST);
	assert_true(story.line.has_trouble);
	end(&story);
}

/* --- a port that is full -------------------------------------------------------------------------- */

static ssize_t take_some(struct db_port *port, const void *bytes, size_t length, db_time now)
{
	struct story *story = (struct story *)port;
	size_t take = length < story->takes ? length : story->takes;

	(void)now;
	if (story->breaks != 0)
		return -story->breaks;
	assert_true(story->taken_length + take <= sizeof(story->taken));
	memcpy(story->taken + story->taken_length, bytes, take);
	story->taken_length += take;
	return (ssize_t)take;
}

static int no_fd(const struct db_port *port)
{
	(void)port;
	return 9;
}

/* With a port that takes so much of what is sent; it is not asked for more yet. */
static void begin_full(struct story *story, size_t takes)
{
	begin(story);
	transport.read = read_nothing;
	transport.write = take_some;
	transport.fd = no_fd;
	transport.write_retry = 0;
	fake_pass(story->bus, 1000 * MS);
	story->takes = takes;
}

static bool is_held(const struct story *story)
{
	return story->bus->engine->port_full_since != 0;
}

static void what_a_port_does_not_take_is_sent_later_in_its_order(void **state)
{
	static const uint8_t bytes[] = "abcdefghijklmnopqrstuvwxyz";
	struct story story = { .answers = true };
	struct pollfd poll;

	(void)state;
	begin_full(&story, 10);
	(void)bus_line_send(&story.line, bytes, 20);
	assert_int_equal(story.taken_length, 10);
	assert_true(is_held(&story));
	/* Bytes of a later frame wait until the rest is sent, or they would overtake it. */
	(void)bus_line_send(&story.line, bytes + 20, 6);
	assert_int_equal(story.taken_length, 10);
	(void)bus_line_poll(&story.line, &poll);
	assert_int_equal(poll.events, POLLIN | POLLOUT);
	bus_line_polled(&story.line, POLLOUT, false);
	assert_int_equal(story.taken_length, 20);
	assert_true(is_held(&story));
	bus_line_polled(&story.line, POLLOUT, false);
	assert_int_equal(story.taken_length, 26);
	assert_memory_equal(story.taken, bytes, 26);
	assert_false(is_held(&story));
	(void)bus_line_poll(&story.line, &poll);
	assert_int_equal(poll.events, POLLIN);
	assert_false(bus_line_check(&story.line, story.bus->now));
	end(&story);
}

static void a_single_byte_that_waits_is_sent(void **state)
{
	struct story story = { .answers = true };
	struct pollfd poll;

	(void)state;
	begin_full(&story, 0);
	(void)bus_line_send(&story.line, (const uint8_t *)"a", 1);
	(void)bus_line_poll(&story.line, &poll);
	assert_int_equal(poll.events, POLLIN | POLLOUT);
	story.takes = 1;
	(void)bus_line_run(&story.line, story.bus->now);
	assert_int_equal(story.taken_length, 1);
	assert_false(is_held(&story));
	end(&story);
}

static void a_port_is_given_up_when_too_many_bytes_wait_for_it(void **state)
{
	static const uint8_t bytes[sizeof(((struct bus_line *)NULL)->unsent)];
	struct story story = { .answers = true };

	(void)state;
	begin_full(&story, 0);
	story.line.last_io = 0;
	(void)bus_line_send(&story.line, bytes, sizeof bytes);
	assert_true(story.line.last_io > 0);
	assert_false(bus_line_check(&story.line, story.bus->now));
	(void)bus_line_send(&story.line, bytes, 1);
	assert_true(bus_line_check(&story.line, story.bus->now));
	assert_int_equal(fake_stats(story.bus).last_error, ENOBUFS);
	end(&story);
}

static db_time run_soon(struct db_port *port, db_time now, int *error)
{
	(void)port;
	(void)error;
	return now + MS;
}

static void a_full_port_runs_as_soon_as_its_transport_wants(void **state)
{
	struct story story = { .answers = true };

	(void)state;
	begin_full(&story, 0);
	transport.run = run_soon;
	transport.write_retry = 5 * MS;
	(void)bus_line_send(&story.line, (const uint8_t *)"abc", 3);
	assert_int_equal(bus_line_run(&story.line, story.bus->now), story.bus->now + MS);
	end(&story);
}

/* It is closed, so that what is behind it may come back. */
static void a_port_that_takes_nothing_is_given_up(void **state)
{
	struct story story = { .answers = true };
	db_time begun;

	(void)state;
	begin_full(&story, 0);
	begun = bus_line_send(&story.line, (const uint8_t *)"abc", 3);
	assert_int_equal(bus_line_run(&story.line, begun), begun + 1000 * MS);
	(void)bus_line_run(&story.line, begun + 1000 * MS);
	assert_false(bus_line_check(&story.line, begun + 1000 * MS));
	/* What it takes at last gives it time again. */
	story.takes = 1;
	(void)bus_line_run(&story.line, begun + 1000 * MS);
	story.takes = 0;
	(void)bus_line_run(&story.line, begun + 2000 * MS);
	assert_false(bus_line_check(&story.line, begun + 2000 * MS));
	(void)bus_line_run(&story.line, begun + 2001 * MS);
	assert_true(bus_line_check(&story.line, begun + 2001 * MS));
	assert_int_equal(fake_stats(story.bus).last_error, ENOBUFS);
	assert_int_equal(story.closes, 1);
	end(&story);
}

/* --- a port that breaks or has much ----------------------------------------------------------------- */

static ssize_t read_zeros(struct db_port *port, void *bytes, size_t size, db_time now)
{
	struct story *story = (struct story *)port;
	size_t count = story->arrives < size ? story->arrives : size;

	(void)now;
	if (story->breaks != 0)
		return -story->breaks;
	memset(bytes, 0, count);
	story->arrives -= count;
	return (ssize_t)count;
}

static void begin_reading(struct story *story)
{
	begin_full(story, sizeof(story->taken));
	transport.read = read_zeros;
}

/* So many frames that no drive of this bus can have sent were received since the place. */
static unsigned count_foreign(const struct story *story, struct db_trace_place *place)
{
	struct db_trace_record record;
	unsigned count = 0;
	uint32_t missed;

	while (db_trace_read(db_engine_trace(story->bus->engine), place, &record, &missed))
		count += record.kind == DB_TRACE_FOREIGN;
	return count;
}

static void all_that_has_arrived_is_read(void **state)
{
	static const size_t lengths[] = { 16, 160, 512, 528, 1024, 4000 * 16 };
	struct story story = { .answers = true };
	struct db_trace_place place;

	(void)state;
	begin_reading(&story);
	place = db_trace_end(db_engine_trace(story.bus->engine));
	for (size_t i = 0; i < sizeof(lengths) / sizeof(lengths[0]); i++) {
		/* Other things have their turn meanwhile. */
		size_t at_once = lengths[i] < 8192 ? lengths[i] : 8192;

		story.arrives = lengths[i];
		/* It has hung up, and what came before that is read first. */
		bus_line_polled(&story.line, POLLIN | POLLHUP, false);
		assert_int_equal(story.arrives, lengths[i] - at_once);
		assert_int_equal(count_foreign(&story, &place), at_once / 16);
		assert_false(bus_line_check(&story.line, story.bus->now));
	}
	/* Byte by byte, too. */
	for (unsigned i = 0; i < 16; i++) {
		story.arrives = 1;
		bus_line_polled(&story.line, POLLIN, false);
	}
	assert_int_equal(count_foreign(&story, &place), 1);
	bus_line_polled(&story.line, POLLIN, false);
	assert_false(bus_line_check(&story.line, story.bus->now));
	bus_line_polled(&story.line, POLLHUP, false);
	assert_true(bus_line_check(&story.line, story.bus->now));
	assert_int_equal(fake_stats(story.bus).last_error, ENODEV);
	end(&story);
}

/* A port that hung up is read until it has no more bytes, and only then given up. A port with a
 * pending error (POLLERR) is read, and stays open. */
static void the_last_bytes_are_read_before_a_port_is_given_up(void **state)
{
	struct story story = { .answers = true };

	(void)state;
	begin_reading(&story);
	story.arrives = 1;
	story.line.last_io = 0;
	bus_line_polled(&story.line, POLLIN | POLLHUP, false);
	assert_true(story.line.last_io > 0);
	assert_false(bus_line_check(&story.line, story.bus->now));
	story.arrives = 1;
	bus_line_polled(&story.line, POLLERR, false);
	assert_int_equal(story.arrives, 0);
	assert_false(bus_line_check(&story.line, story.bus->now));
	bus_line_polled(&story.line, POLLNVAL, false);
	assert_true(bus_line_check(&story.line, story.bus->now));
	end(&story);
}

static void a_port_that_breaks_is_given_up(void **state)
{
	(void)state;
	for (unsigned way = 0; way < 3; way++) {
		struct story story = { .answers = true };

		begin_reading(&story);
		if (way == 2) {
			story.takes = 1;
			(void)bus_line_send(&story.line, (const uint8_t *)"abc", 3);
		}
		story.breaks = EIO;
		if (way == 0)
			bus_line_polled(&story.line, POLLIN, false);
		else if (way == 1)
			(void)bus_line_send(&story.line, (const uint8_t *)"abc", 3);
		else
			bus_line_polled(&story.line, POLLOUT, false);
		assert_true(bus_line_check(&story.line, story.bus->now));
		assert_int_equal(fake_stats(story.bus).last_error, EIO);
		end(&story);
	}
}

static db_time run_port(struct db_port *port, db_time now, int *error)
{
	const struct story *story = (const struct story *)port;

	*error = -story->breaks;
	return now + 7 * MS;
}

/* As an adapter does that is asked what it does. */
static void a_port_that_finds_itself_broken_is_given_up(void **state)
{
	struct story story = { .answers = true };
	db_time now;

	(void)state;
	begin(&story);
	transport.run = run_port;
	transport.fd = no_fd;
	fake_pass(story.bus, 1000 * MS);
	now = story.bus->now;
	assert_true(bus_line_run(&story.line, now) == now + 7 * MS);
	assert_false(bus_line_check(&story.line, now));
	story.breaks = EPROTO;
	(void)bus_line_run(&story.line, now);
	assert_true(bus_line_check(&story.line, now));
	assert_int_equal(fake_stats(story.bus).last_error, EPROTO);
	end(&story);
}

static const struct db_port_health *tell_health(const struct db_port *port)
{
	return &((const struct story *)port)->health;
}

/* Its controller went off the bus: the port stays, and the bus is down until it is back. */
static void a_controller_that_is_off_the_bus_is_waited_for(void **state)
{
	struct story story = { .answers = true, .health = { .up = true } };
	struct told told = { .count = 0 };
	struct db_trace_place place;

	(void)state;
	begin_told(&story, &told);
	transport.write = take_some;
	transport.fd = no_fd;
	transport.health = tell_health;
	fake_pass(story.bus, 1000 * MS);
	/* Something was not sent yet. */
	(void)bus_line_send(&story.line, (const uint8_t *)"abc", 3);
	place = db_trace_end(db_engine_trace(story.bus->engine));
	story.health = (struct db_port_health){ .up = false, .error = ENETRESET };
	(void)bus_line_run(&story.line, story.bus->now);
	assert_int_equal(event_behind(&story, &place), DB_EVENT_BUS_OFF);
	assert_false(fake_stats(story.bus).up);
	assert_int_equal(fake_stats(story.bus).last_error, ENETRESET);
	story.takes = sizeof(story.taken);
	story.health = (struct db_port_health){ .up = true, .bitrate = 250000 };
	fake_pass(story.bus, 1000 * MS);
	assert_true(fake_is_online(story.bus, 0));
	/* What is old by now is not sent. */
	assert_int_equal(story.taken_length, 0);
	story.health = (struct db_port_health){ .up = false, .error = ENETDOWN };
	(void)bus_line_run(&story.line, story.bus->now);
	story.health = (struct db_port_health){ .up = true, .bitrate = 500000 };
	(void)bus_line_run(&story.line, story.bus->now);
	assert_int_equal(story.closes, 0);
	end_told(&story);
	assert_int_equal(told.count, 6);
	assert_string_equal(
		told.lines[1],
		"can0: bus off, too many errors on the wire; check wiring, termination and "
		"bit rate");
	assert_string_equal(told.lines[2], "can0 is up");
	assert_string_equal(
		told.lines[3],
		"can0 runs at 250000 bit/s, but the configuration says bitrate = 500000; set "
		"both to that of the drives");
	assert_string_equal(told.lines[4], "can0: Network is down");
	assert_string_equal(told.lines[5], "can0 is up");
}

/* --- a port that wakes the thread up when an answer is whole ------------------------------------- */

#define USUAL 12 /* bytes of an answer */

static bool note_gather(struct db_port *port, size_t bytes)
{
	struct story *story = (struct story *)port;

	assert_true(story->gather_count < sizeof(story->gathered) / sizeof(story->gathered[0]));
	story->gathered[story->gather_count++] = bytes;
	return !story->cannot_gather;
}

static db_time take_time_of_answer(const struct db_bus_config *bus, const uint8_t *request,
                                   size_t request_length, size_t answer_length)
{
	return take_no_time(bus, request, request_length, answer_length) * (db_time)answer_length;
}

/* The caller's until it has ended. */
static void begin_gathering(struct story *story, struct db_driver *driver)
{
	begin(story);
	*driver = *story->bus->config.driver;
	driver->usual_answer = USUAL;
	story->bus->config.driver = driver;
	transport.gather = note_gather;
	transport.fd = no_fd;
	(void)bus_line_run(&story->line, story->bus->now);
}

/* When it looks by itself, where so much is awaited and so much of it has come. */
static db_time looks_at(struct story *story, size_t awaited, size_t come)
{
	struct db_engine *engine = story->bus->engine;
	unsigned flights = engine->flights;
	size_t length = engine->received_length;
	struct pollfd poll;
	db_time at;

	engine->flights = awaited > 0;
	engine->late_until = 0;
	engine->awaited = awaited;
	engine->received_length = come;
	at = bus_line_poll(&story->line, &poll);
	assert_int_equal(poll.events, POLLIN);
	engine->flights = flights;
	engine->received_length = length;
	return at;
}

static void a_port_that_gathers_is_looked_at_for_what_it_does_not_report(void **state)
{
	const db_time byte = 100 * DB_NS_PER_US;
	struct story story = { .answers = true };
	struct db_driver driver;

	(void)state;
	begin_gathering(&story, &driver);
	assert_int_equal(story.gather_count, 1);
	assert_int_equal(story.gathered[0], USUAL);
	story.line.last_io = 5000 * MS;
	transport.wire_time = take_time_of_answer;
	/* Nothing is awaited, or just what it reports by itself. */
	assert_true(looks_at(&story, 0, 0) == DB_TIME_NEVER);
	assert_true(looks_at(&story, USUAL, 0) == DB_TIME_NEVER);
	/* The rest of a usual one takes as long as its bytes do. */
	assert_true(looks_at(&story, USUAL, 4) == 5000 * MS + 8 * byte);
	assert_true(looks_at(&story, USUAL, 11) == 5000 * MS + MS / 4);
	/* Another one may come at any time. */
	assert_true(looks_at(&story, 8, 0) == 5000 * MS + MS);
	assert_true(looks_at(&story, 40, 0) == 5000 * MS + MS);
	assert_true(looks_at(&story, 40, 39) == 5000 * MS + MS);
	assert_true(looks_at(&story, USUAL, USUAL) == 5000 * MS + MS);
	/* One that cannot gather reports each byte. */
	story.line.gathers = 0;
	assert_true(looks_at(&story, 8, 0) == DB_TIME_NEVER);
	end(&story);
}

/* A scan is told each byte, and a port that was opened again begins anew. */
static void what_a_port_gathers_follows_who_uses_it(void **state)
{
	static const size_t gathered[] = { USUAL, 0, USUAL, USUAL };
	const struct db_scan_plan plan = { .first = ADDRESS, .last = ADDRESS };
	struct story story = { .answers = true };
	struct db_driver driver;

	(void)state;
	begin_gathering(&story, &driver);
	fake_pass(story.bus, 1000 * MS);
	story.scan = scan_new(&story.bus->config, &plan, 1);
	assert_non_null(story.scan);
	scan_begin(story.bus->engine, story.scan, story.bus->now);
	fake_pass(story.bus, 2 * MS);
	assert_int_equal(story.gather_count, 2);
	fake_pass(story.bus, 3000 * MS);
	assert_null(story.bus->engine->scan);
	assert_int_equal(story.gather_count, 3);
	story.line.port_error = ENODEV;
	assert_true(bus_line_check(&story.line, story.bus->now));
	fake_pass(story.bus, 1000 * MS);
	assert_int_equal(story.opens, 2);
	assert_int_equal(story.gather_count, 4);
	assert_memory_equal(story.gathered, gathered, sizeof gathered);
	scan_free(story.scan);
	end(&story);
}

/* Then it is not asked in vain for what it cannot, and what has come is found without it. */
static void a_port_that_cannot_gather_is_read_when_it_says_so(void **state)
{
	struct story story = { .answers = true, .cannot_gather = true };
	struct db_driver driver;

	(void)state;
	begin_gathering(&story, &driver);
	assert_int_equal(story.line.gathers, 0);
	assert_true(looks_at(&story, 8, 0) == DB_TIME_NEVER);
	end(&story);
}

/* Before an answer is given up, what has come of it is read; not where nothing is awaited, or where each byte is reported. */
static void what_has_come_of_a_late_answer_is_read(void **state)
{
	static const struct {
		size_t gathers;
		size_t awaited;
		bool late;
		bool is_read;
	} cases[] = { { USUAL, 8, true, true },
		      { USUAL, 8, false, false },
		      { USUAL, 0, true, false },
		      { 0, 8, true, false } };

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct story story = { .answers = true, .arrives = 16 };
		struct db_driver driver;

		begin_gathering(&story, &driver);
		transport.read = read_zeros;
		story.line.gathers = cases[i].gathers;
		story.bus->engine->flights = cases[i].awaited > 0;
		story.bus->engine->late_until = 0;
		story.bus->engine->awaited = cases[i].awaited;
		bus_line_polled(&story.line, 0, cases[i].late);
		assert_int_equal(story.arrives == 0, cases[i].is_read);
		story.bus->engine->flights = 0;
		end(&story);
	}
}

/* --- a scan that has the line to itself --------------------------------------------------------- */

static struct db_scan_progress scan_at(struct story *story, unsigned first, unsigned second)
{
	const struct db_scan_plan plan = { .first = ADDRESS,
		                           .last = ADDRESS,
		                           .aside = true,
		                           .speed_count = 2,
		                           .speeds = { first, second } };
	struct db_scan_progress progress = { .end = DB_SCAN_RUNS };

	story->scan = scan_new(&story->bus->config, &plan, 1);
	assert_non_null(story->scan);
	scan_begin(story->bus->engine, story->scan, story->bus->now);
	for (unsigned i = 0; i < 1000 && progress.end == DB_SCAN_RUNS; i++) {
		fake_pass(story->bus, 10 * MS);
		db_seqlock_read(&story->scan->sequence, story->scan->words, &progress,
		                sizeof(progress));
	}
	return progress;
}

static void a_scan_has_the_line_at_each_speed_and_gives_it_back(void **state)
{
	static const unsigned speeds[] = { 500000, 250000, 1000000, 500000 };
	struct story story = { .answers = true };
	struct db_scan_progress progress;

	(void)state;
	begin(&story);
	fake_pass(story.bus, 1000 * MS);
	assert_true(fake_is_online(story.bus, 0));
	progress = scan_at(&story, 250000, 1000000);
	assert_int_equal(progress.end, DB_SCAN_DONE);
	assert_int_equal(progress.finds, 2);
	assert_int_equal(progress.asked, 2);
	assert_int_equal(progress.total, 2);
	assert_int_equal(story.scan->finds[0].speed, 250000);
	assert_int_equal(story.scan->finds[1].speed, 1000000);
	assert_false(fake_is_online(story.bus, 0));
	fake_pass(story.bus, 1000 * MS);
	assert_true(fake_is_online(story.bus, 0));
	assert_int_equal(story.opens, 4);
	assert_int_equal(story.closes, 3);
	for (unsigned i = 0; i < 4; i++) {
		assert_int_equal(story.opened[i], speeds[i]);
		/* A scan hears everybody. */
		assert_int_equal(story.filtered[i] == 0, i == 1 || i == 2);
	}
	scan_free(story.scan);
	end(&story);
}

/* Neither what it did not take, which is old by then, nor what was wrong with it. */
static void a_port_that_is_opened_anew_has_nothing_of_the_one_before(void **state)
{
	struct story story = { .answers = true };

	(void)state;
	begin(&story);
	transport.write = take_some;
	(void)bus_line_send(&story.line, (const uint8_t *)"abc", 3);
	assert_int_equal(story.line.unsent_length, 3);
	story.line.port_error = EIO;
	/* A scan of another speed follows one that has the line to itself. */
	story.line.use = LINE_ASIDE;
	bus_line_begin_scan(&story.line, story.bus->now);
	assert_int_equal(story.closes, 1);
	story.line.use = LINE_IN_SERVICE;
	story.takes = sizeof(story.taken);
	(void)bus_line_run(&story.line, story.bus->now);
	assert_int_equal(story.opens, 2);
	assert_int_equal(story.taken_length, 0);
	assert_false(bus_line_check(&story.line, story.bus->now));
	end(&story);
}

/* Nothing can be asked at a port that is gone: the bus gets its line back. */
static void a_scan_ends_with_its_port(void **state)
{
	struct story story = { .answers = true };
	struct db_scan_progress progress;

	(void)state;
	begin(&story);
	fake_pass(story.bus, 1000 * MS);
	story.refuses = ENODEV;
	progress = scan_at(&story, 250000, 1000000);
	assert_int_equal(progress.end, DB_SCAN_PORT);
	assert_int_equal(progress.error, ENODEV);
	story.refuses = 0;
	fake_pass(story.bus, 3000 * MS);
	assert_true(fake_is_online(story.bus, 0));
	assert_int_equal(story.opened[story.opens - 1], 500000);
	scan_free(story.scan);
	end(&story);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_drive_that_answers_leaves_them_closed),
		cmocka_unit_test(they_are_open_while_a_silent_drive_is_asked),
		cmocka_unit_test(a_port_is_closed_at_the_end),
		cmocka_unit_test(a_family_without_filters_has_none),
		cmocka_unit_test(answers_to_another_host_are_named),
		cmocka_unit_test(a_port_that_cannot_be_opened_is_told_with_what_to_do),
		cmocka_unit_test(a_port_that_is_busy_names_nobody_who_is_not_known),
		cmocka_unit_test(a_port_that_was_lost_is_closed_and_opened_again),
		cmocka_unit_test(a_port_that_is_lost_again_is_told_of_again),
		cmocka_unit_test(the_holder_of_a_port_is_known_only_while_the_port_is_busy),
		cmocka_unit_test(the_trace_has_when_the_port_came_and_went),
		cmocka_unit_test(what_a_port_does_not_take_is_sent_later_in_its_order),
		cmocka_unit_test(a_single_byte_that_waits_is_sent),
		cmocka_unit_test(a_port_is_given_up_when_too_many_bytes_wait_for_it),
		cmocka_unit_test(a_full_port_runs_as_soon_as_its_transport_wants),
		cmocka_unit_test(a_port_that_takes_nothing_is_given_up),
		cmocka_unit_test(all_that_has_arrived_is_read),
		cmocka_unit_test(the_last_bytes_are_read_before_a_port_is_given_up),
		cmocka_unit_test(a_port_that_breaks_is_given_up),
		cmocka_unit_test(a_port_that_finds_itself_broken_is_given_up),
		cmocka_unit_test(a_controller_that_is_off_the_bus_is_waited_for),
		cmocka_unit_test(a_port_that_gathers_is_looked_at_for_what_it_does_not_report),
		cmocka_unit_test(what_a_port_gathers_follows_who_uses_it),
		cmocka_unit_test(a_port_that_cannot_gather_is_read_when_it_says_so),
		cmocka_unit_test(what_has_come_of_a_late_answer_is_read),
		cmocka_unit_test(a_scan_has_the_line_at_each_speed_and_gives_it_back),
		cmocka_unit_test(a_port_that_is_opened_anew_has_nothing_of_the_one_before),
		cmocka_unit_test(a_scan_ends_with_its_port),
	};

	return cmocka_run_group_tests_name("sched/bus_line", tests, NULL, NULL);
}
