/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/bus_line.h"

#include "codec/can.h"
#include "drivebridge/bus.h"
#include "drivebridge/clock.h"
#include "drivebridge/trace.h"
#include "drivebridge/trouble.h"
#include "sched/bus_log.h"
#include "sched/change.h"
#include "sched/engine.h"
#include "sched/scan.h"

#include <errno.h>
#include <string.h>
#include <time.h>

#define REOPEN_INTERVAL (500 * DB_NS_PER_MS)

/* Number of reads from a port before the cycle and stops have their turn again. */
#define READS_AT_ONCE 16

/* Polling interval for an answer of unknown length, and at most for the rest of one. */
#define LOOK_INTERVAL (1 * DB_NS_PER_MS)
#define LOOK_INTERVAL_MIN (DB_NS_PER_MS / 4)

/* A port that takes nothing for this time counts as lost. */
#define STUCK_TIME (1 * DB_NS_PER_S)

/* The first error counts; the port is closed at the end of the turn. */
static void fail_port(struct bus_line *line, int error)
{
	if (line->port_error == 0)
		line->port_error = error;
}

db_time bus_line_send(struct bus_line *line, const uint8_t *bytes, size_t length)
{
	db_time now = db_clock_now();
	ssize_t sent = 0;

	if (line->unsent_length + length > sizeof(line->unsent)) {
		fail_port(line, ENOBUFS); /* cannot happen: nothing is sent while bytes are held */
		return now;
	}
	line->last_io = now;
	if (line->unsent_length == 0)
		sent = line->transport->write(line->port, bytes, length, now);
	if (sent < 0) {
		fail_port(line, (int)-sent);
		return now;
	}
	if ((size_t)sent == length)
		return now;
	/* The kernel's buffer is full: the rest follows as soon as it drains. */
	memcpy(line->unsent + line->unsent_length, bytes + sent, length - (size_t)sent);
	line->unsent_length += length - (size_t)sent;
	line->unsent_since = now;
	db_engine_hold(line->engine, true, now);
	return now;
}

void bus_line_trace(struct bus_line *line, enum db_event event, const struct db_drive_config *drive,
                    db_time now)
{
	db_trace_write_event(db_engine_trace(line->engine), now, event, drive ? drive->name : NULL);
	line->has_trouble = line->has_trouble || db_trace_is_trouble(event);
}

/* --- the port --------------------------------------------------------------------------------- */

const char *bus_line_place(const struct bus_line *line)
{
	return line->transport->uses_interface ? line->config->interface : line->config->device;
}

const struct db_port_health *bus_line_health(const struct bus_line *line)
{
	static const struct db_port_health fine = { .up = true };

	return line->port && line->transport->health ? line->transport->health(line->port) : &fine;
}

static void bring_up(struct bus_line *line, db_time now)
{
	unsigned bitrate = bus_line_health(line)->bitrate;
	enum db_port_latency latency = bus_line_health(line)->latency;

	line->line_up = true;
	if (line->use == LINE_ASIDE) {
		scan_port(line->engine, true, 0, now);
		return;
	}
	bus_line_trace(line, DB_EVENT_BUS_UP, NULL, now);
	db_log(line->log, now, DB_EVENT_BUS_UP, NULL, "%s is up", bus_line_place(line));
	if (bitrate != 0 && bitrate != line->config->bitrate)
		db_log(line->log, now, DB_EVENT_BUS_BITRATE, NULL,
		       "%s runs at %u bit/s, but the configuration says bitrate = %u; set both to "
		       "that of the drives",
		       bus_line_place(line), bitrate, line->config->bitrate);
	if (latency == DB_PORT_LATENCY_LOW)
		db_log(line->log, now, DB_EVENT_SERIAL_LATENCY, NULL,
		       "%s passes received bytes on at once", bus_line_place(line));
	else if (latency == DB_PORT_LATENCY_REFUSED)
		db_log(line->log, now, DB_EVENT_SERIAL_LATENCY, NULL,
		       "the driver of %s has no low latency setting; if answers are late by about "
		       "16 ms, see latency_timer in the udev example",
		       bus_line_place(line));
	line->open_error = 0;
	db_engine_port(line->engine, true, 0, now);
}

static void bring_down(struct bus_line *line, int error, db_time now)
{
	line->line_up = false;
	line->unsent_length = 0;
	if (line->use == LINE_ASIDE)
		scan_port(line->engine, false, error, now);
	else
		db_engine_port(line->engine, false, error, now);
}

/* Lets the thread sleep until a whole answer is there, so that it wakes up once. A scan also reads
 * what others send. */
static void set_read_size(struct bus_line *line, bool answers)
{
	size_t bytes = answers ? line->config->driver->usual_answer : 0;

	if (line->transport->gather && bytes != line->gathers)
		line->gathers = line->transport->gather(line->port, bytes) ? bytes : 0;
}

static void open_port(struct bus_line *line, db_time now)
{
	char advice[DB_TROUBLE_ADVICE_MAX];
	struct db_can_filter filters[DB_FILTERS_MAX];
	const struct db_driver *driver = line->config->driver;
	size_t count = driver->filters ? driver->filters(line->config, filters) : 0;
	const struct db_bus_config *aside = scan_port_config(line->engine);
	int error = line->use == LINE_ASIDE ?
	                    line->transport->open(aside, NULL, 0, now, &line->port) :
	                    line->transport->open(line->config, filters, count, now, &line->port);
	/* The process that has a busy port. */
	pid_t holder = error == -EBUSY && line->transport->holder ?
	                       line->transport->holder(line->config) :
	                       0;

	line->holder[0] = '\0';
	if (holder != 0)
		db_process_words(holder, line->holder);
	line->passes_all = false;
	line->gathers = 0;
	if (error == 0) {
		set_read_size(line, line->engine->scan == NULL);
		return;
	}
	line->port = NULL;
	line->reopen_at = now + REOPEN_INTERVAL;
	if (line->use == LINE_ASIDE) {
		scan_port(line->engine, false, -error, now);
		return;
	}
	db_engine_port(line->engine, false, -error, now);
	if (-error != line->open_error) {
		bus_log_port_advice(line->config, -error, line->holder, advice);
		db_log(line->log, now, DB_EVENT_BUS_LOST, NULL,
		       "cannot open %s: %s%s; trying again", bus_line_place(line), strerror(-error),
		       advice);
	}
	line->open_error = -error;
}

bool bus_line_check(struct bus_line *line, db_time now)
{
	int error = line->port_error;
	char advice[DB_TROUBLE_ADVICE_MAX];

	if (!line->port || error == 0)
		return false;
	bus_line_trace(line, DB_EVENT_BUS_LOST, NULL, now);
	if (error != line->open_error && line->use != LINE_ASIDE) {
		bus_log_port_advice(line->config, error, "", advice);
		db_log(line->log, now, DB_EVENT_BUS_LOST, NULL,
		       "lost %s: %s%s; waiting for it to come back", bus_line_place(line),
		       strerror(error), advice);
	}
	line->transport->close(line->port);
	line->port = NULL;
	line->port_error = 0;
	line->open_error = error;
	line->reopen_at = now + REOPEN_INTERVAL;
	bring_down(line, error, now);
	return true;
}

/* Follows adapters that are not ready yet, and controllers that went bus off and return. */
static void follow_health(struct bus_line *line, db_time now)
{
	const struct db_port_health *health = bus_line_health(line);

	if (!line->port || health->up == line->line_up)
		return;
	if (health->up) {
		bring_up(line, now);
		return;
	}
	if (line->use == LINE_ASIDE)
		return; /* expected at another speed than the drives' */
	bus_line_trace(line, DB_EVENT_BUS_OFF, NULL, now);
	db_log(line->log, now, DB_EVENT_BUS_OFF, NULL, "%s: %s", bus_line_place(line),
	       health->error == ENETRESET ? "bus off, too many errors on the wire; check wiring, "
	                                    "termination and bit rate" :
	                                    strerror(health->error));
	bring_down(line, health->error, now);
}

/* False when nothing was read. If more is left after the last read, poll() reports it again. */
static bool read_port(struct bus_line *line)
{
	uint8_t bytes[512];
	ssize_t count = 0;

	for (unsigned reads = 0; reads < READS_AT_ONCE; reads++) {
		line->last_io = db_clock_now();
		count = line->transport->read(line->port, bytes, sizeof(bytes), line->last_io);
		if (count > 0)
			db_engine_receive(line->engine, bytes, (size_t)count, db_clock_now());
		if (count < 0)
			fail_port(line, (int)-count);
		if (count < (ssize_t)sizeof(bytes))
			return reads > 0 || count > 0;
	}
	return true;
}

static void write_rest(struct bus_line *line, db_time now)
{
	ssize_t sent = line->transport->write(line->port, line->unsent, line->unsent_length, now);

	if (sent < 0) {
		fail_port(line, (int)-sent);
		return;
	}
	line->unsent_length -= (size_t)sent;
	memmove(line->unsent, line->unsent + sent, line->unsent_length);
	if (line->unsent_length == 0)
		db_engine_hold(line->engine, false, now);
	else if (sent > 0)
		line->unsent_since = now;
	else if (now - line->unsent_since > STUCK_TIME)
		fail_port(line, ENOBUFS);
}

/* --- a line that is out of service ------------------------------------------------------------ */

static void close_port(struct bus_line *line, db_time now)
{
	line->transport->close(line->port);
	line->port = NULL;
	line->port_error = 0;
	line->unsent_length = 0;
	line->line_up = false;
	line->reopen_at = now;
}

static unsigned speed_of(const struct db_bus_config *config)
{
	return config->driver->medium == DB_MEDIUM_CAN ? config->bitrate : config->baud;
}

/* Hands the line from its drives to a scan that wants it alone, from one speed to the next, and
 * back. */
static void follow_scan(struct bus_line *line, db_time now)
{
	const struct db_bus_config *aside = scan_port_config(line->engine);
	bool scans = line->engine->scan != NULL;

	if (line->port)
		set_read_size(line, !scans);
	if (line->use == LINE_IN_SERVICE && aside) {
		const char *whose = scans ? line->engine->scan->plan.whose : "";

		db_log(line->log, now, DB_EVENT_BUS_ASIDE, NULL,
		       "%s is out of service for a scan%s%s: its drives are left as on-exit says, "
		       "and are offline until it has ended",
		       bus_line_place(line), whose[0] ? " of " : "", whose);
		db_engine_shut_down(line->engine, now);
		line->clear_by = now + DB_EXIT_TIME;
		line->use = LINE_CLEARING;
	}
	if (line->use == LINE_CLEARING &&
	    (db_engine_is_quiet(line->engine, true) || now >= line->clear_by)) {
		db_engine_set_aside(line->engine, now);
		close_port(line, now);
		line->use = LINE_ASIDE;
		line->aside_speed = aside ? speed_of(aside) : 0;
	}
	if (line->use != LINE_ASIDE)
		return;
	if (!aside) {
		close_port(line, now);
		line->use = LINE_IN_SERVICE;
		db_log(line->log, now, DB_EVENT_BUS_ASIDE, NULL, "%s returns to service",
		       bus_line_place(line));
	} else if (speed_of(aside) != line->aside_speed) {
		close_port(line, now);
		line->aside_speed = speed_of(aside);
	}
}

db_time bus_line_run(struct bus_line *line, db_time now)
{
	db_time next = DB_TIME_NEVER;
	bool pass_all;
	int error = 0;

	follow_scan(line, now);
	if (!line->port && now >= line->reopen_at)
		open_port(line, now);
	if (!line->port)
		return line->reopen_at;
	/* The kernel's filters pass only frames of the configured drives, so that other traffic
	 * costs nothing. A scan must see all frames, and so must the search for the reason why a
	 * drive is not understood. */
	pass_all = line->engine->scan || db_engine_wants_all_frames(line->engine, now);
	if (line->transport->pass && pass_all != line->passes_all) {
		line->transport->pass(line->port, pass_all);
		line->passes_all = pass_all;
	}
	if (line->transport->run)
		next = line->transport->run(line->port, now, &error);
	if (error < 0)
		fail_port(line, -error);
	if (line->unsent_length > 0)
		write_rest(line, now);
	if (line->unsent_length > 0) {
		db_time retry = line->transport->write_retry > 0 ? line->transport->write_retry :
		                                                   STUCK_TIME;

		next = now + retry < next ? now + retry : next;
	}
	follow_health(line, now);
	return next;
}

db_time bus_line_poll(const struct bus_line *line, struct pollfd *poll)
{
	db_time interval = LOOK_INTERVAL;
	size_t awaited;
	size_t come;

	poll->fd = line->port ? line->transport->fd(line->port) : -1;
	poll->events = POLLIN;
	if (line->unsent_length > 0 && line->transport->write_retry == 0)
		poll->events |= POLLOUT;
	if (!line->port || line->gathers == 0)
		return DB_TIME_NEVER;
	/* The port does not report an answer shorter than usual, nor the rest of a longer one:
	 * these are polled for. The rest of a usual answer after an echo arrives by itself, and
	 * takes as long as its bytes do. */
	awaited = db_engine_awaited(line->engine, &come);
	if (awaited == 0 || (awaited == line->gathers && come == 0))
		return DB_TIME_NEVER;
	if (come < awaited && awaited == line->gathers)
		interval = line->transport->wire_time(line->config, NULL, 0, awaited - come);
	if (interval < LOOK_INTERVAL_MIN)
		interval = LOOK_INTERVAL_MIN;
	return line->last_io + interval;
}

void bus_line_polled(struct bus_line *line, short revents, bool late)
{
	size_t come;

	if (revents & POLLOUT)
		write_rest(line, db_clock_now());
	/* A hung-up port without more data would wake us for ever. (A socket with a pending error
	 * reports it by read(), and is fine afterwards.) */
	if ((revents & (POLLIN | POLLHUP | POLLERR | POLLNVAL)) && !read_port(line) &&
	    (revents & (POLLHUP | POLLNVAL)))
		fail_port(line, ENODEV);
	/* Before an answer times out, the bytes received of it are read. */
	if (late && line->port && line->gathers > 0 && db_engine_awaited(line->engine, &come) > 0)
		(void)read_port(line);
}

void bus_line_begin_scan(struct bus_line *line, db_time now)
{
	if (line->use == LINE_ASIDE)
		close_port(line, now);
}

void bus_line_close(struct bus_line *line)
{
	line->transport->close(line->port);
	line->port = NULL;
}
