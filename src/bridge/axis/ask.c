/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/axis_private.h"

#include "drivebridge/command_table.h"
#include "drivebridge/commander.h"
#include "drivebridge/scale.h"

#include <errno.h>
#include <stdlib.h>

/* --- what the drive can do -------------------------------------------------------------------- */

static bool is_supported(const struct db_commander *commander, enum db_command command)
{
	return command < DB_CMD_LIMIT && (commander->config.commands & DB_COMMAND_BIT(command));
}

/* True if the command ends the watchdog's latch, which is set. */
static bool clears_latch(const struct db_commander *commander, enum db_command command)
{
	return commander->watchdog.latched && command == DB_CMD_CLEAR_FAULT;
}

unsigned db_commander_input_ports(const struct db_commander *commander)
{
	const struct db_driver *driver = commander->config.driver;
	struct db_nameplate_copy copy;
	const struct db_nameplate *plate = &copy.plate;

	if (!driver->input_ports || db_flight_has(commander, DB_PENDING_SETTINGS, NULL))
		return 0;
	db_axis_read_nameplate(commander->config.axis, &copy);
	return plate->doubtful ? 0 : driver->input_ports(plate);
}

/* --- permission ------------------------------------------------------------------------------- */

static struct db_limit_facts collect_limit_facts(const struct db_commander *commander)
{
	const struct db_driver *driver = commander->config.driver;
	const struct db_drive_config *drive = commander->config.drive_config;
	int param = driver->preset_velocity_param;
	struct db_limit_facts facts = { 0 };
	struct db_snapshot snapshot;
	union db_value preset;

	db_axis_read(commander->config.axis, &snapshot);
	facts.counts = db_scale_counts(drive, &snapshot.feedback);
	facts.scale_open = db_scale_is_open(driver, drive, &snapshot.feedback);
	facts.position = snapshot.feedback.position;
	facts.velocity_counts = db_driver_velocity_counts(driver, drive);
	if (param < 0 || (size_t)param >= driver->param_count)
		return facts;
	facts.has_preset = db_axis_read_param(commander->config.axis, (size_t)param, &preset) &&
	                   !db_flight_has(commander, DB_PENDING_SETTINGS, NULL);
	facts.preset_velocity = (float)db_value_number(driver->params[param].type, preset);
	return facts;
}

struct db_allowed db_commander_allowed(const struct db_commander *commander)
{
	struct db_limit_facts facts = collect_limit_facts(commander);

	return db_limits_allowed(commander->config.drive_config, &facts);
}

/* Whether the drive has the command, the arguments are in the documented ranges, and the limits of
 * the configuration are kept. */
static enum db_result check_command(struct db_commander *commander, struct db_writer *writer,
                                    const struct db_request *request)
{
	const struct db_commander_config *config = &commander->config;
	enum db_result result = DB_RESULT_UNSUPPORTED;
	struct db_limit_facts facts;
	enum db_limit limit;

	if (!db_command_find(request->command))
		return DB_RESULT_OUT_OF_RANGE;
	if (is_supported(commander, request->command))
		result = config->driver->check ?
		                 config->driver->check(config->bus_config, config->drive_config,
		                                       request->command, request->args) :
		                 DB_RESULT_OK;
	/* The latch is the bridge's own: it also ends where the drive has nothing to clear. */
	if (result == DB_RESULT_UNSUPPORTED && !request->staged &&
	    clears_latch(commander, request->command))
		result = DB_RESULT_OK;
	if (result != DB_RESULT_OK)
		return result;
	facts = collect_limit_facts(commander);
	limit = db_limits_command(config->drive_config, request->command, request->args, &facts);
	db_writers_set_limit(&commander->writers, writer, limit);
	return limit == DB_LIMIT_NONE ? DB_RESULT_OK : DB_RESULT_LIMIT;
}

/* The result that is known before the drive is asked; OK: ask it. */
static enum db_result permit(struct db_commander *commander, struct db_writer *writer,
                             const struct db_request *request)
{
	enum db_command command = request->command;
	enum db_result result = check_command(commander, writer, request);

	if (result != DB_RESULT_OK)
		return result;
	if (db_command_may_move(command) && request->hold_ms != 0 &&
	    !db_hold_may_begin(&commander->hold, request))
		return DB_RESULT_OUT_OF_RANGE;
	/* The ports are set on the drive one after the other, and it would refuse one in the
	 * middle. */
	if (command == DB_CMD_SET_OUTPUTS &&
	    (request->args->output_mask & db_commander_input_ports(commander)) != 0)
		return DB_RESULT_REFUSED;
	/* Ids are kept per writer: without one there is no id. */
	if (request->id != 0 && writer && writer->last.id == 0 && !db_command_is_stop(command))
		return DB_RESULT_RESTARTED;
	if (commander->watchdog.latched && db_command_may_move(command))
		return DB_RESULT_LATCHED;
	return DB_RESULT_OK;
}

/* The limit that would be broken is then shown. */
static enum db_result permit_settings(struct db_commander *commander, struct db_writer *writer,
                                      const struct db_request *request)
{
	const struct db_driver *driver = commander->config.driver;
	struct db_limit_facts facts = collect_limit_facts(commander);

	for (size_t i = 0; i < request->setting_count; i++) {
		const struct db_setting *setting = &request->settings[i];
		int param = setting->param;
		double acceleration;
		enum db_limit limit;

		if (param != driver->acceleration_param && param != driver->deceleration_param)
			continue;
		acceleration = db_value_number(driver->params[param].type, setting->value) *
		               facts.velocity_counts;
		limit = db_limits_acceleration(commander->config.drive_config, acceleration,
		                               &facts);
		db_writers_set_limit(&commander->writers, writer, limit);
		if (limit != DB_LIMIT_NONE)
			return DB_RESULT_LIMIT;
	}
	return DB_RESULT_OK;
}

/* --- one command ------------------------------------------------------------------------------ */

/* Ends a command without the bus. */
static struct db_write_answer end_without_bus(struct db_commander *commander,
                                              const struct db_request *request,
                                              enum db_result result)
{
	struct db_writer *writer = db_writers_find(&commander->writers, db_request_client(request));

	db_writers_set_command(&commander->writers, writer, request, result, 0);
	if (db_command_replaces_motion(request->command))
		db_writers_refuse_motion(&commander->writers, writer, commander->submitted);
	db_outcome_record(commander, request, result, NULL);
	db_outcome_log(commander, db_request_client(request),
	               &(struct db_refused_write){ .command = request->command, .result = result });
	return (struct db_write_answer){ .result = result };
}

/*
 * The execution that the request repeats: of the id that was used last, or for a write of `command`
 * alone whose kept id was used, of what was executed last, if it asks for the same. Null: it
 * repeats nothing. A stop always executes.
 */
static const struct db_used_id *find_first(const struct db_writer *writer,
                                           const struct db_request *request)
{
	if (!writer || db_command_is_stop(request->command))
		return NULL;
	if (request->id != 0 && request->id == writer->last.id)
		return writer->last.result == DB_RESULT_BUSY ? NULL : &writer->last;
	if (request->bare && writer->has_executed &&
	    writer->executed_command == (uint16_t)request->command &&
	    db_command_same_args(request->command, &writer->executed_args, request->args))
		return &writer->execution;
	return NULL;
}

/* True if the latch is all there is to clear: the drive has no fault that can be cleared. */
static bool is_only_latched(const struct db_commander *commander)
{
	struct db_snapshot snapshot;

	if (!is_supported(commander, DB_CMD_CLEAR_FAULT))
		return true;
	db_axis_read(commander->config.axis, &snapshot);
	return snapshot.feedback.error == DB_ERROR_NONE;
}

/* Why a permitted command does not go to the bus all the same; OK: it does. */
static enum db_result find_obstacle(const struct db_commander *commander,
                                    const struct db_request *request, db_time arrived)
{
	bool moves = db_command_may_move(request->command);
	enum db_result result = db_flight_reach(commander, request->command);

	if (result != DB_RESULT_OK)
		return result;
	/* It waited in a buffer until its hold would be over already. */
	if (moves && request->counted && request->hold_ms != 0 &&
	    request->submitted - arrived >= (db_time)request->hold_ms * DB_NS_PER_MS)
		return DB_RESULT_CANCELLED;
	/* It waited in a buffer while the stop overtook it. */
	if (moves && arrived < commander->stopped)
		return DB_RESULT_CANCELLED;
	/* Otherwise it would overtake an earlier stop that still has to be repeated. */
	if (!db_command_is_stop(request->command) &&
	    db_flight_has(commander, DB_PENDING_STOP_AGAIN, NULL))
		return DB_RESULT_BUSY;
	return DB_RESULT_OK;
}

static struct db_write_answer submit(struct db_commander *commander, struct db_request *request,
                                     struct db_write_token token)
{
	const struct db_client *client = db_request_client(request);
	struct db_writer *writer = db_writers_find(&commander->writers, client);
	db_time arrived = db_client_arrived(client, request->submitted);
	enum db_result result = find_obstacle(commander, request, arrived);
	struct db_request *pending = NULL;

	request->ends_latch = clears_latch(commander, request->command);
	if (result == DB_RESULT_OK)
		pending = db_flight_submit(commander, request);
	if (!pending)
		return end_without_bus(commander, request,
		                       result == DB_RESULT_OK ? DB_RESULT_BUSY : result);
	if (db_command_is_stop(request->command))
		db_flight_replace_stop(commander, pending);
	if (db_command_may_move(request->command)) {
		/* The stop that ended a hold and found no room is no longer sent: this motion was
		 * admitted after it. */
		if (commander->reaction_cause == DB_STAND_HOLD)
			commander->reaction_again_at = DB_TIME_NEVER;
		pending->held = request->hold_ms != 0 && client;
		if (pending->held)
			db_hold_begin(&commander->hold, pending,
			              request->counted ? arrived : request->submitted);
		db_watchdog_arm(&commander->watchdog, arrived);
	}
	db_motion_submitted(commander, writer, request->command, request->submitted);
	db_outcome_record(commander, request, DB_RESULT_PENDING, pending);
	commander->newest = pending->ticket;
	db_writer_set_executed(writer, request, DB_RESULT_PENDING, pending->ticket);
	db_writers_set_command(&commander->writers, writer, request, DB_RESULT_PENDING,
	                       pending->ticket);
	return db_flight_wait(commander, pending, token, request->submitted);
}

static struct db_write_answer decide(struct db_commander *commander, struct db_request *request,
                                     struct db_write_token token)
{
	struct db_writer *writer = db_writers_find(&commander->writers, db_request_client(request));
	enum db_result result = permit(commander, writer, request);
	struct db_request *stop = NULL;

	if (result != DB_RESULT_OK)
		return end_without_bus(commander, request, result);
	/* A drive that cannot be asked keeps the latch: its current state is not known. */
	if (clears_latch(commander, request->command) && is_only_latched(commander)) {
		result = db_flight_reach(commander, DB_CMD_CLEAR_FAULT);
		if (result == DB_RESULT_OK) {
			db_guard_unlatch(commander, request->submitted);
			db_writer_set_executed(writer, request, DB_RESULT_OK, 0);
		}
		return end_without_bus(commander, request, result);
	}
	if (db_command_is_stop(request->command))
		stop = db_flight_join_stop(commander, request->command);
	if (!stop)
		return submit(commander, request, token);

	/* A stop of the same kind is pending, and serves this request, too. */
	if (writer)
		db_outcome_ask_motion(&writer->own);
	db_writer_set_executed(writer, request, DB_RESULT_PENDING, stop->ticket);
	if (stop->again)
		db_motion_submitted(commander, writer, request->command, request->submitted);
	db_outcome_join(commander, request, stop);
	db_writers_set_command(&commander->writers, writer, request, DB_RESULT_PENDING,
	                       stop->ticket);
	return db_flight_wait(commander, stop, token, request->submitted);
}

static bool may_succeed_later(enum db_result result)
{
	return result == DB_RESULT_BUSY || result == DB_RESULT_OFFLINE ||
	       result == DB_RESULT_BUS_DOWN;
}

/*
 * Notes which client commands the drive. If that client falls silent the drive is stopped; a client
 * that only stops the drive may fall silent. A refused command counts for nothing, and a repeated
 * id only shows that its writer is alive if that client commands the drive: any client can repeat
 * it. After a start a PLC that continues with its last block is recognised by its first id, which
 * it repeats, while no other client commands.
 */
static void count_commander(struct db_commander *commander, const struct db_request *request,
                            struct db_write_answer answer, bool repeated)
{
	const struct db_client *client = db_request_client(request);
	struct db_watchdog *watchdog = &commander->watchdog;
	bool is_baseline = !answer.later && answer.result == DB_RESULT_RESTARTED;
	bool counts = db_write_is_taken(answer) || is_baseline;
	db_time arrived = db_client_arrived(client, request->submitted);

	if (!client)
		return;
	if (repeated || is_baseline)
		counts = counts && (!db_watchdog_is_commanded_by(watchdog, NULL) ||
		                    db_watchdog_is_commanded_by(watchdog, client));
	/* A client that only clears a fault or reads parameters has started no motion. */
	if (counts && (db_command_may_move(request->command) || request->command == DB_CMD_ENABLE))
		db_watchdog_commanded(watchdog, client);
	if (counts && (!db_watchdog_is_commanded_by(watchdog, NULL) ||
	               db_watchdog_is_commanded_by(watchdog, client)))
		db_commander_feed(commander, client, DB_FEED_WRITES, arrived);
	else if (!answer.later && may_succeed_later(answer.result))
		db_commander_feed(commander, client, DB_FEED_REQUESTS, arrived);
}

static struct db_write_answer carry_out(struct db_commander *commander, struct db_request *request,
                                        struct db_write_token token)
{
	const struct db_client *client = db_request_client(request);
	struct db_writer *writer = db_writers_find(&commander->writers, client);
	const struct db_used_id *first = find_first(writer, request);
	struct db_write_answer answer;

	request->cause = DB_STAND_CLIENT;
	db_guard_check_hold(commander, request->submitted);
	if (db_command_is_stop(request->command))
		db_motion_stopped(commander, db_client_arrived(client, request->submitted));
	if (first) {
		/* The same command again: it gets the answer of the first time. */
		struct db_request *pending = db_flight_find(commander, first->ticket);

		answer.result = commander->config.accept_writes && first->sent ? DB_RESULT_OK :
		                                                                 first->result;
		answer.later = false;
		db_writers_set_write(&commander->writers, writer, first->result, 0,
		                     pending ? pending->ticket : 0);
		if (pending)
			answer = db_flight_wait(commander, pending, token, request->submitted);
	} else {
		answer = decide(commander, request, token);
	}
	count_commander(commander, request, answer, first != NULL);
	return answer;
}

static struct db_write_answer write_settings(struct db_commander *commander,
                                             struct db_request *request,
                                             struct db_write_token token)
{
	const struct db_driver *driver = commander->config.driver;
	const struct db_client *client = db_request_client(request);
	struct db_writer *writer = db_writers_find(&commander->writers, client);
	enum db_result result = permit_settings(commander, writer, request);
	struct db_request *pending = NULL;
	size_t first = request->settings[0].param;

	if (result == DB_RESULT_OK)
		result = db_flight_reach(commander, DB_CMD_NONE);
	if (result == DB_RESULT_OK) {
		pending = db_flight_submit(commander, request);
		result = pending ? DB_RESULT_PENDING : DB_RESULT_BUSY;
	}
	if (client && (pending || may_succeed_later(result)))
		db_commander_feed(commander, client, pending ? DB_FEED_WRITES : DB_FEED_REQUESTS,
		                  db_client_arrived(client, request->submitted));
	db_outcome_record(commander, request, result, pending);
	db_writers_set_write(&commander->writers, writer, result, 0, pending ? pending->ticket : 0);
	if (pending) {
		db_settle_submitted(commander, pending);
		/* A later stop must not join one from before this, which would then be the last
		 * command. */
		commander->newest = pending->ticket;
		return db_flight_wait(commander, pending, token, request->submitted);
	}
	db_outcome_log(
		commander, client,
		&(struct db_refused_write){
			.param = first < driver->param_count ? driver->params[first].name : NULL,
			.result = result,
		});
	return (struct db_write_answer){ .result = result };
}

/* --- what is asked ---------------------------------------------------------------------------- */

struct db_write_answer db_commander_ask(struct db_commander *commander,
                                        const struct db_request *asked, struct db_write_token token,
                                        db_time now)
{
	static const struct db_args none;
	struct db_request request = *asked;

	request.submitted = now;
	if (request.setting_count > 0)
		return write_settings(commander, &request, token);
	if (!request.args)
		request.args = &none;
	request.hold_beat = commander->kept.hold_beat;
	db_writers_claim(&commander->writers, db_request_client(&request), now);
	return carry_out(commander, &request, token);
}

/* A command of the block, with its arguments. */
static struct db_request request_of(const struct db_command_block *block, uint16_t command,
                                    const struct db_client *client, db_time now)
{
	struct db_request request = {
		.args = &block->args,
		.submitted = now,
		.command = (enum db_command)command,
		.hold_ms = block->hold_ms,
		.hold_beat = block->hold_beat,
		.counted = true,
	};

	if (client)
		request.client = *client;
	return request;
}

/* A staged command is checked now, so that the start of a group brings no surprises. */
static struct db_write_answer stage(struct db_commander *commander,
                                    const struct db_command_write *write,
                                    const struct db_client *client, bool commands, db_time now)
{
	struct db_request staged = request_of(&write->block, write->block.staged_command, client,
	                                      now);
	struct db_writer *writer = db_writers_find(&commander->writers, db_request_client(&staged));
	enum db_result result = DB_RESULT_OUT_OF_RANGE;

	staged.staged = true;
	/* Not together with a command in the same write. */
	if (!commands)
		result = check_command(commander, writer, &staged);
	if (result != DB_RESULT_OK)
		return end_without_bus(commander, &staged, result);
	return (struct db_write_answer){ .result = DB_RESULT_OK };
}

struct db_write_answer db_commander_write(struct db_commander *commander,
                                          const struct db_client *client,
                                          const struct db_command_write *write,
                                          struct db_write_token token, db_time now)
{
	bool stages = write->has_staged && write->block.staged_command != DB_CMD_NONE;
	bool commands = write->has_command && write->block.command != DB_CMD_NONE;
	bool stops = commands && db_command_is_stop((enum db_command)write->block.command);
	struct db_request request = request_of(&write->block, write->block.command, client, now);
	struct db_write_answer answer = (struct db_write_answer){ .result = DB_RESULT_OK };
	struct db_writer *writer = NULL;

	/* Writing only arguments takes no place from clients that use ids. */
	if (stages || commands || write->has_id)
		writer = db_writers_claim(&commander->writers, client, now);
	if (stages && !stops) {
		answer = stage(commander, write, client, commands, now);
	} else if (commands) {
		/* A stop wins over a staged command in the same write. A write of `command` alone
		 * has the kept id, unless that was used already. */
		request.by_block = true;
		request.bare = !write->has_id && writer && write->block.command_id != 0 &&
		               write->block.command_id == writer->last.id;
		request.id = request.bare || !writer ? 0 : write->block.command_id;
		answer = carry_out(commander, &request, token);
	}
	if (!db_write_is_taken(answer))
		return answer;
	commander->kept = write->block;
	if (write->has_beat && client &&
	    db_hold_count(&commander->hold, client, write->block.hold_beat,
	                  db_client_arrived(client, now), now))
		db_commander_feed(commander, client, DB_FEED_WRITES,
		                  db_client_arrived(client, now));
	if (write->has_id && writer)
		writer->kept_id = write->block.command_id;
	return answer;
}

enum db_command db_commander_staged(const struct db_commander *commander)
{
	return (enum db_command)commander->kept.staged_command;
}

struct db_write_answer db_commander_start_staged(struct db_commander *commander,
                                                 const struct db_client *client, uint32_t group,
                                                 struct db_write_token token, db_time now)
{
	struct db_command_block block = commander->kept;
	struct db_request request = request_of(&block, block.staged_command, client, now);

	db_writers_claim(&commander->writers, client, now);
	request.group = group;
	commander->kept.staged_command = DB_CMD_NONE;
	return carry_out(commander, &request, token);
}

void db_commander_set_refused(struct db_commander *commander, const struct db_client *client,
                              enum db_result result, uint16_t address)
{
	struct db_request form = { .command = DB_CMD_NONE };

	db_writers_set_write(&commander->writers, db_writers_find(&commander->writers, client),
	                     result, address, 0);
	db_outcome_log(commander, client,
	               &(struct db_refused_write){ .address = address, .result = result });
	/* A write that was refused for its form is in the audit trail alone. */
	if (client)
		form.client = *client;
	if (commander->ops->record)
		(void)commander->ops->record(commander->context, &(struct db_recorded){
									 .request = &form,
									 .result = result,
									 .address = address,
								 });
}

void db_commander_refuse(struct db_commander *commander, const struct db_request *request,
                         enum db_result result, uint16_t address)
{
	const struct db_setting unknown = { .param = DB_HISTORY_UNKNOWN };
	struct db_request refused = *request;

	if (refused.command == DB_CMD_NONE)
		refused.settings = &unknown;
	db_writers_set_write(&commander->writers,
	                     db_writers_find(&commander->writers, db_request_client(request)),
	                     result, address, 0);
	db_outcome_log(commander, db_request_client(request),
	               &(struct db_refused_write){ .command = request->command, .result = result });
	db_outcome_record(commander, &refused, result, NULL);
}
