/* SPDX-License-Identifier: Apache-2.0 */
#include "server/plc_lines.h"

#include "drivebridge/loop_clock.h"
#include "server/rtu_port.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#define HEADER 6u /* of Modbus TCP, before the unit; a line has none */
#define CRC 2u

struct line {
	struct db_plc_lines *lines;
	const struct db_rtu_config *config;
	struct db_rtu_port *port;
	sd_event_source *ready;
	struct db_client client;
	bool up;
	struct db_rtu_figures seen; /* of the port, when it was looked at last */
	uint32_t requests;
	uint32_t repeated;
	db_time since;  /* when it came up */
	db_time active; /* last request */
	struct db_diagnostics diagnostics;

	/* The last request for a unit of this gateway. */
	struct db_modbus_request request; /* its data is invalid */
	struct db_rtu_frame frame;        /* of it, or of its last repetition */
	bool pending;                     /* the backend owes an answer to a write */
	bool answered;                    /* it has answered, and that is to be sent */
	uint8_t exception;                /* which says this */
	uint32_t sequence;
};

struct db_plc_lines {
	struct db_plc_lines_host host;
	struct line **lines; /* in the configuration's order */
	size_t count;
};

struct db_plc_lines_change {
	const struct db_modbus_config *config;
	struct line **lines;
	bool *made; /* in the same order: this change owns it */
	size_t count;
};

struct db_plc_lines *db_plc_lines_new(const struct db_plc_lines_host *host)
{
	struct db_plc_lines *lines = calloc(1, sizeof(*lines));

	if (lines)
		lines->host = *host;
	return lines;
}

/* --- the client ------------------------------------------------------------------------------- */

static void announce(const struct line *line, bool connected)
{
	const struct db_executor *executor = line->lines->host.executor;

	if (executor->backend->client)
		executor->backend->client(executor->context, &line->client, connected);
}

/* The port was opened, or is lost: whoever was there is gone. */
static void follow_port(struct line *line, const struct db_rtu_figures *figures)
{
	struct db_log_source source = *line->lines->host.log;
	char text[DB_CLIENT_ADDRESS_MAX];
	const struct db_log_about about = { .client = text };
	db_time now = db_loop_now(line->lines->host.loop);

	if (line->up && (!figures->up || figures->openings != line->seen.openings)) {
		line->up = false;
		line->pending = false;
		announce(line, false);
	}
	if (figures->up && !line->up) {
		line->up = true;
		line->since = now;
		line->active = line->since;
		line->client.id = line->lines->host.number(line->lines->host.context);
		line->frame.length = 0;
		announce(line, true);
	}
	source.level = line->config->log;
	db_client_address(line->client.address, text);
	if (figures->up)
		db_log(&source, now, DB_EVENT_LINE_UP, &about, "a PLC at %s is answered (%s)",
		       line->config->device,
		       line->client.may_write ? "may read and write" : "may only read");
	else
		db_log(&source, now, DB_EVENT_LINE_LOST, &about,
		       "%s: %s, so its PLC cannot be heard; it is tried again: check device, "
		       "plug and adapter",
		       line->config->device, strerror(figures->error));
}

static void refuse(const struct line *line, enum db_refusal kind)
{
	const struct db_plc_lines_host *host = &line->lines->host;

	host->refused(host->context, line->client.address, kind);
}

/* --- requests --------------------------------------------------------------------------------- */

static void send_answer(struct line *line, const struct db_modbus_request *request,
                        uint8_t exception)
{
	const struct db_plc_lines_host *host = &line->lines->host;
	uint8_t adu[DB_ADU_MAX + CRC];
	size_t length;
	uint16_t crc;

	if (exception)
		length = db_pdu_exception(request, exception, adu);
	else if (request->function == DB_FC_DIAGNOSTICS)
		length = db_pdu_diagnostic(request, &line->diagnostics, adu);
	else
		length = db_execute_answer(host->executor, &line->client, request, adu, &exception);
	db_diagnostics_count_answer(&line->diagnostics, exception);
	if (exception > 0 && exception < DB_EXCEPTION_CODES) {
		host->stats->exceptions++;
		host->stats->exceptions_by_code[exception]++;
	}
	crc = db_rtu_crc(adu + HEADER, length - HEADER);
	adu[length] = (uint8_t)crc;
	adu[length + 1] = (uint8_t)(crc >> 8);
	db_rtu_port_answer(line->port, line->frame.number, adu + HEADER, length - HEADER + CRC);
}

/* Refuses or begins a request: 0, an exception, or DB_WRITE_LATER. */
static int begin_request(struct line *line, const struct db_modbus_request *request)
{
	const struct db_executor *executor = line->lines->host.executor;
	const struct db_backend *backend = executor->backend;
	uint8_t exception = 0;

	if (line->client.role)
		exception = backend->role(executor->context, &line->client, request->unit);
	if (exception || request->write_count == 0)
		return exception;
	if (!line->client.may_write) {
		refuse(line, line->config->may_write ? DB_REFUSED_ROLE : DB_REFUSED_LINE);
		if (backend->denied)
			backend->denied(executor->context, &line->client, request->unit,
			                request->write_address);
		return MODBUS_EXCEPTION_ILLEGAL_FUNCTION;
	}
	return db_execute_write(executor, &line->client, request,
	                        (struct db_write_token){ line->client.id, ++line->sequence });
}

/*
 * To all units, without an answer: so nobody would know whether it was carried out, and only a stop
 * is.
 */
static void handle_broadcast(struct line *line, const struct db_modbus_request *request)
{
	const struct db_executor *executor = line->lines->host.executor;
	uint16_t values[MODBUS_MAX_WRITE_REGISTERS];

	db_diagnostics_add(&line->diagnostics, DB_DIAGNOSTIC_NO_ANSWERS, 1);
	if (request->function != MODBUS_FC_WRITE_SINGLE_REGISTER &&
	    request->function != MODBUS_FC_WRITE_MULTIPLE_REGISTERS) {
		refuse(line, DB_REFUSED_BROADCAST);
		return;
	}
	if (!line->client.may_write) {
		refuse(line, line->config->may_write ? DB_REFUSED_ROLE : DB_REFUSED_LINE);
		return;
	}
	db_pdu_values(request, values);
	if (!executor->backend->broadcast(executor->context, &line->client, line->config->units,
	                                  request->write_address, request->write_count, values))
		refuse(line, DB_REFUSED_BROADCAST);
}

/*
 * The same write again, while the first one is in work, or was done too late to be answered: its
 * PLC has had no answer, and repeats it. Long after that it is a new wish: its PLC has given up.
 */
static bool is_repeated(const struct line *line, const struct db_rtu_frame *frame)
{
	db_time soon = 2 * (db_time)line->config->answer_timeout_ms * DB_NS_PER_MS;

	return line->request.write_count > 0 && frame->length == line->frame.length &&
	       memcmp(frame->bytes, line->frame.bytes, frame->length) == 0 &&
	       line->seen.sent != line->frame.number &&
	       (line->pending || frame->at - line->frame.at < soon);
}

/* A stop acts each time: another client may have moved the drive since the first one. */
static bool is_stop(const struct line *line, const struct db_modbus_request *request)
{
	const struct db_executor *executor = line->lines->host.executor;
	uint16_t values[MODBUS_MAX_WRITE_REGISTERS];

	if (request->function != MODBUS_FC_WRITE_SINGLE_REGISTER &&
	    request->function != MODBUS_FC_WRITE_MULTIPLE_REGISTERS)
		return false;
	db_pdu_values(request, values);
	return executor->backend->stops(executor->context, &line->client, request->unit,
	                                request->write_address, request->write_count, values);
}

static void handle_frame(struct line *line, const struct db_rtu_frame *frame)
{
	const struct db_executor *executor = line->lines->host.executor;
	size_t length = HEADER + frame->length - CRC;
	uint8_t adu[HEADER + DB_RTU_FRAME_MAX] = { 0 };
	struct db_modbus_request request;
	int result;

	memcpy(adu + HEADER, frame->bytes, frame->length - CRC);
	result = db_pdu_parse(adu, length, &request);
	/* A unit that is not there may be another device's, whatever the configuration says. */
	if (request.unit != 0 &&
	    executor->backend->unit(executor->context, &line->client, request.unit))
		return;
	line->requests++;
	line->lines->host.stats->requests++;
	db_diagnostics_add(&line->diagnostics, DB_DIAGNOSTIC_MESSAGES, 1);
	line->client.arrived = frame->at;
	line->active = frame->at;
	if (request.unit == 0) {
		if (result == 0)
			handle_broadcast(line, &request);
		return;
	}
	if (is_repeated(line, frame) && (line->pending || !is_stop(line, &request))) {
		line->repeated++;
		line->frame.number = frame->number;
		line->frame.at = frame->at;
		if (!line->pending)
			send_answer(line, &line->request, line->exception);
		return;
	}
	/* The answer to an earlier write would be taken for that to this request. */
	line->pending = false;
	line->frame = *frame;
	line->request = request;
	line->request.data = NULL;
	if (result == 0)
		result = begin_request(line, &request);
	line->pending = result == DB_WRITE_LATER;
	line->answered = false;
	line->exception = line->pending ? 0 : (uint8_t)result;
	if (!line->pending)
		send_answer(line, &request, line->exception);
}

static int on_ready(sd_event_source *source, int fd, uint32_t revents, void *userdata)
{
	struct line *line = userdata;
	const struct db_plc_lines_host *host = &line->lines->host;
	const struct db_rtu_figures *seen = &line->seen;
	struct db_diagnostics *diagnostics = &line->diagnostics;
	struct db_rtu_figures figures;
	struct db_rtu_frame frame;
	bool any;

	(void)source;
	(void)fd;
	(void)revents;
	host->begin(host->context);
	do {
		/* Taken first: frames come after the opening of their port. */
		any = db_rtu_port_take(line->port, &frame);
		/* What the port has counted counts for FC 8, too. */
		db_rtu_port_read(line->port, &figures);
		db_diagnostics_add(diagnostics, DB_DIAGNOSTIC_BUS_MESSAGES,
		                   figures.frames - seen->frames);
		db_diagnostics_add(diagnostics, DB_DIAGNOSTIC_BUS_ERRORS, figures.bad - seen->bad);
		db_diagnostics_add(diagnostics, DB_DIAGNOSTIC_OVERRUNS,
		                   figures.overruns - seen->overruns);
		if (figures.up != seen->up || figures.openings != seen->openings ||
		    figures.error != seen->error)
			follow_port(line, &figures);
		line->seen = figures;
		if (any && line->up)
			handle_frame(line, &frame);
	} while (any);
	host->end(host->context);
	return 0;
}

bool db_plc_lines_has(const struct db_plc_lines *lines, uint32_t client)
{
	for (size_t i = 0; lines && i < lines->count; i++) {
		if (lines->lines[i]->up && lines->lines[i]->client.id == client)
			return true;
	}
	return false;
}

bool db_plc_lines_answer(struct db_plc_lines *lines, struct db_write_token token, uint8_t exception)
{
	for (size_t i = 0; lines && i < lines->count; i++) {
		struct line *line = lines->lines[i];

		if (!line->up || line->client.id != token.client)
			continue;
		if (line->pending && !line->answered && line->sequence == token.sequence) {
			line->answered = true;
			line->exception = exception;
		}
		return true;
	}
	return false;
}

void db_plc_lines_flush(struct db_plc_lines *lines)
{
	for (size_t i = 0; lines && i < lines->count; i++) {
		struct line *line = lines->lines[i];

		if (!line->pending || !line->answered)
			continue;
		line->pending = line->answered = false;
		send_answer(line, &line->request, line->exception);
	}
}

/* --- which lines there are -------------------------------------------------------------------- */

static void free_line(struct line *line)
{
	if (!line)
		return;
	sd_event_source_disable_unref(line->ready);
	if (line->up) {
		line->up = false;
		announce(line, false);
	}
	db_rtu_port_end(line->port);
	free(line);
}

void db_plc_lines_free(struct db_plc_lines *lines)
{
	if (!lines)
		return;
	while (lines->count > 0)
		free_line(lines->lines[--lines->count]);
	free(lines->lines);
	free(lines);
}

/* What a client of it may do. */
static void set_rights(struct line *line, const struct db_rtu_config *config)
{
	const struct db_role_config *role = config->role;

	line->config = config;
	line->client.role = role;
	line->client.may_write = config->may_write &&
	                         (!role || role->write.all || role->write.names || role->control);
}

static int make_line(struct db_plc_lines *lines, const struct db_rtu_config *config,
                     struct line **line)
{
	struct line *made = calloc(1, sizeof(*made));
	int error;

	if (!made)
		return -ENOMEM;
	made->lines = lines;
	made->client.port = 1;
	made->client.endpoint = config->endpoint;
	db_client_address_of_line(config->name, made->client.address);
	set_rights(made, config);
	error = db_rtu_port_new(config, &made->port);
	if (error == 0)
		error = sd_event_add_io(lines->host.loop, &made->ready, db_rtu_port_fd(made->port),
		                        EPOLLIN, on_ready, made);
	if (error < 0) {
		free_line(made);
		return error;
	}
	*line = made;
	return 0;
}

/* Rights and the level of the log may differ: nobody notices when they change. */
static bool same_port(const struct db_rtu_config *a, const struct db_rtu_config *b)
{
	return strcmp(a->name, b->name) == 0 && strcmp(a->device, b->device) == 0 &&
	       a->baud == b->baud && a->parity == b->parity && a->stop_bits == b->stop_bits &&
	       a->direction == b->direction && a->rts_before_ms == b->rts_before_ms &&
	       a->rts_after_ms == b->rts_after_ms && a->endpoint == b->endpoint &&
	       memcmp(a->units, b->units, sizeof(a->units)) == 0 &&
	       a->answer_timeout_ms == b->answer_timeout_ms;
}

int db_plc_lines_prepare(struct db_plc_lines *lines, const struct db_modbus_config *config,
                         struct db_plc_lines_change **change)
{
	struct db_plc_lines_change *made = calloc(1, sizeof(*made));
	int error = 0;

	if (!made)
		return -ENOMEM;
	made->config = config;
	/* One more than needed: calloc() of nothing may give null. */
	made->lines = calloc(config->line_count + 1, sizeof(struct line *));
	made->made = calloc(config->line_count + 1, sizeof(bool));
	if (!made->lines || !made->made)
		error = -ENOMEM;
	for (size_t i = 0; error == 0 && i < config->line_count; i++) {
		struct line *same = NULL;

		for (size_t j = 0; !same && j < lines->count; j++) {
			if (same_port(lines->lines[j]->config, &config->lines[i]))
				same = lines->lines[j];
		}
		made->made[i] = !same;
		made->lines[i] = same;
		if (!same)
			error = make_line(lines, &config->lines[i], &made->lines[i]);
		made->count += error == 0;
	}
	if (error != 0) {
		db_plc_lines_change_free(made);
		return error;
	}
	*change = made;
	return 0;
}

void db_plc_lines_change_free(struct db_plc_lines_change *change)
{
	if (!change)
		return;
	for (size_t i = 0; i < change->count; i++) {
		if (change->made[i])
			free_line(change->lines[i]);
	}
	free(change->lines);
	free(change->made);
	free(change);
}

void db_plc_lines_apply(struct db_plc_lines *lines, struct db_plc_lines_change *change)
{
	const struct db_executor *executor = lines->host.executor;
	struct line **before = lines->lines;
	size_t count = lines->count;

	lines->lines = change->lines;
	lines->count = change->count;
	for (size_t i = 0; i < count; i++) {
		bool stays = false;

		for (size_t j = 0; j < lines->count; j++)
			stays = stays || lines->lines[j] == before[i];
		if (!stays)
			free_line(before[i]);
	}
	for (size_t i = 0; i < lines->count; i++) {
		struct line *line = lines->lines[i];
		bool could_write = line->client.may_write;

		if (change->made[i]) {
			db_rtu_port_begin(line->port);
			continue;
		}
		/* The rights of a line that goes on may be others. */
		set_rights(line, &change->config->lines[i]);
		if (!line->up || !could_write)
			continue;
		if (!line->client.may_write && executor->backend->restricted)
			executor->backend->restricted(executor->context, &line->client);
		else if (line->client.role && executor->backend->reassigned)
			executor->backend->reassigned(executor->context, &line->client);
	}
	free(before);
	free(change->made);
	free(change);
}

/* --- for people ------------------------------------------------------------------------------- */

size_t db_plc_lines_list(const struct db_plc_lines *lines, struct db_server_client *clients,
                         size_t max, db_time now)
{
	size_t count = 0;

	for (size_t i = 0; lines && i < lines->count && count < max; i++) {
		const struct line *line = lines->lines[i];

		if (line->up)
			clients[count++] = (struct db_server_client){
				.client = line->client,
				.requests = line->requests,
				.idle = now > line->active ? now - line->active : 0,
				.connected = now > line->since ? now - line->since : 0,
			};
	}
	return count;
}

bool db_plc_lines_read(const struct db_plc_lines *lines, size_t index, struct db_server_line *line)
{
	struct db_rtu_figures figures;

	if (!lines || index >= lines->count)
		return false;
	db_rtu_port_read(lines->lines[index]->port, &figures);
	*line = (struct db_server_line){
		.name = lines->lines[index]->config->name,
		.device = lines->lines[index]->config->device,
		.up = figures.up,
		.error = figures.error,
		.requests = lines->lines[index]->requests,
		.answers = figures.answers,
		.repeated = lines->lines[index]->repeated,
		.late = figures.late,
		.missed = figures.missed,
		.foreign = figures.foreign,
		.bad = figures.bad,
		.overruns = figures.overruns,
		.echoes = figures.echoes,
	};
	return true;
}
