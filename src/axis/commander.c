/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/commander.h"

#include "axis/account.h"
#include "axis/admission.h"
#include "axis/motion.h"
#include "axis/reaction.h"
#include "axis/requests.h"
#include "axis/state.h"

#include <errno.h>
#include <stdlib.h>

/* Who asks for a command, and for which. */
struct order {
	const struct db_client *client; /* null: nobody in particular */
	struct db_writer *writer;       /* its memory; null: it has none, and no ids */
	struct db_command_block block;
	uint16_t id;               /* 0: none */
	bool by_block;             /* by the command block, where a write may be sent again */
	bool bare;                 /* ... without a command_id */
	uint32_t group;            /* see struct db_request */
	struct db_hold_terms hold; /* of 0 ms: a motion goes on by itself */
	struct db_write_token token;
	db_time now;
};

/* --- making ------------------------------------------------------------------------------------------ */

int db_commander_new(const struct db_commander_config *config, const struct db_commander_ops *ops,
                     void *context, struct db_commander **commander)
{
	const struct db_pending *neighbour = config->neighbour ? &config->neighbour->pending : NULL;
	struct db_commander *made = calloc(1, sizeof *made);

	if (!made)
		return -ENOMEM;
	if (db_pending_init(&made->pending, config->bus_config->queue, neighbour) != 0 ||
	    (config->ids_by_client && db_writers_reserve(&made->writers) != 0)) {
		db_commander_free(made);
		return -ENOMEM;
	}
	made->config = *config;
	made->config.neighbour = NULL; /* it may go first */
	made->ops = ops;
	made->context = context;
	made->stop_repeat_at = DB_TIME_NEVER;
	made->reaction_again_at = DB_TIME_NEVER;
	db_writers_set(&made->writers, config->ids_by_client);
	made->check_interval = db_motion_check_interval(config->bus_config);
	db_watchdog_init(&made->watchdog,
	                 config->on_client_loss == DB_CMD_NONE ? 0 : config->watchdog_ms,
	                 config->drive_config->watchdog_feed);
	made->find_at = made->watchdog.timeout_ms == 0 ? DB_TIME_NEVER : 0;
	*commander = made;
	return 0;
}

void db_commander_free(struct db_commander *commander)
{
	if (!commander)
		return;
	db_pending_release(&commander->pending);
	db_writers_release(&commander->writers);
	free(commander);
}

int db_commander_reserve(struct db_commander *commander, bool ids_by_client)
{
	return ids_by_client ? db_writers_reserve(&commander->writers) : 0;
}

void db_commander_set_writers(struct db_commander *commander, unsigned confirm_ms,
                              bool accept_writes, bool ids_by_client)
{
	commander->config.confirm_ms = confirm_ms;
	commander->config.accept_writes = accept_writes;
	if (commander->writers.by_address == ids_by_client)
		return;
	/* Whose an id was cannot be said any more: each begins with a baseline again. */
	db_writers_set(&commander->writers, ids_by_client);
}

void db_commander_dismiss(struct db_commander *commander)
{
	db_requests_dismiss(commander, DB_RESULT_CANCELLED);
}

/* --- one command ------------------------------------------------------------------------------------- */

static struct db_write_answer answer_now(enum db_result result)
{
	return (struct db_write_answer){ .result = result };
}

/* Ends a command without the bus. */
static struct db_write_answer end_order(struct db_commander *commander, const struct order *order,
                                        enum db_result result)
{
	enum db_command command = (enum db_command)order->block.command;

	db_writers_set_command(&commander->writers, order->writer, order->id, order->block.command,
	                       result, 0);
	if (db_command_replaces_motion(command))
		db_writers_refuse_motion(&commander->writers, order->writer);
	db_account_add_command(commander, order->client, &order->block, order->id, result, NULL);
	db_account_log_refusal(commander, order->client,
	                       &(struct db_refused_write){
				       .command = command,
				       .result = result,
			       });
	return answer_now(result);
}

/* The same came again: its answer is that of the first time. */
static struct db_write_answer repeat_order(struct db_commander *commander,
                                           const struct order *order,
                                           const struct db_used_id *first)
{
	struct db_slot *slot = db_requests_find(commander, first->ticket);

	db_writers_set_write(&commander->writers, order->writer, first->result, 0,
	                     slot ? slot->ticket : 0);
	if (slot)
		return db_requests_wait(commander, slot, order->token, order->now);
	return answer_now(commander->config.accept_writes && first->sent ? DB_RESULT_OK :
	                                                                   first->result);
}

/* A stop of the same kind is under way, and is its own, too. */
static struct db_write_answer join_order(struct db_commander *commander, const struct order *order,
                                         struct db_slot *stop)
{
	if (order->writer)
		db_writer_ask_motion(order->writer);
	if (order->writer && order->by_block)
		db_writer_set_executed(order->writer, &order->block, order->id, DB_RESULT_PENDING,
		                       stop->ticket);
	if (stop->again)
		db_motion_note_submitted(commander, order->writer, stop->command, order->now);
	db_history_repeat(&commander->history, stop->entry);
	db_writers_set_command(&commander->writers, order->writer, order->id, order->block.command,
	                       DB_RESULT_PENDING, stop->ticket);
	return db_requests_wait(commander, stop, order->token, order->now);
}

/* Whether the latch is all there is to clear: the drive itself has no fault, or nothing that could
 * clear it. */
static bool is_only_latched(const struct db_commander *commander)
{
	struct db_snapshot snapshot;

	if (!db_admission_is_supported(commander, DB_CMD_CLEAR_FAULT))
		return true;
	db_axis_read(commander->config.axis, &snapshot);
	return snapshot.feedback.error == DB_ERROR_NONE;
}

/* The latch of a drive that has no fault itself. One that cannot be asked keeps it: what it does
 * now nobody knows. */
static struct db_write_answer end_latch(struct db_commander *commander, const struct order *order)
{
	enum db_result result = db_requests_reach(commander, DB_CMD_CLEAR_FAULT);

	if (result != DB_RESULT_OK)
		return end_order(commander, order, result);
	db_reaction_unlatch(commander, order->now);
	if (order->writer && order->by_block)
		db_writer_set_executed(order->writer, &order->block, order->id, DB_RESULT_OK, 0);
	return end_order(commander, order, DB_RESULT_OK);
}

/* A motion is on its way. */
static void begin_hold(struct db_commander *commander, const struct order *order,
                       struct db_slot *slot)
{
	db_reaction_forget_hold(commander);
	if (order->hold.span_ms == 0 || !order->client)
		return;
	slot->held = true;
	db_hold_begin(&commander->hold, order->client, &order->hold, slot->order,
	              order->hold.counted ? db_client_arrived(order->client, order->now) :
	                                    order->now);
}

/* It would be held for less than no time: what waited in a buffer until now is not begun. */
static bool is_overdue(const struct order *order)
{
	db_time arrived = db_client_arrived(order->client, order->now);

	return order->hold.span_ms != 0 && order->hold.counted &&
	       db_command_may_move((enum db_command)order->block.command) &&
	       order->now - arrived >= (db_time)order->hold.span_ms * DB_NS_PER_MS;
}

static struct db_write_answer submit_order(struct db_commander *commander,
                                           const struct order *order)
{
	enum db_command command = (enum db_command)order->block.command;
	enum db_result result = db_requests_reach(commander, command);
	struct db_request request = {
		.command = command,
		.args = order->block.args,
		.submitted = order->now,
		.group = order->group,
		.cause = DB_STAND_CLIENT,
	};
	struct db_slot *slot;

	if (result == DB_RESULT_OK && is_overdue(order))
		result = DB_RESULT_CANCELLED;
	if (result != DB_RESULT_OK)
		return end_order(commander, order, result);
	/* It waited in a buffer while the stop went past it. */
	if (db_command_may_move(command) &&
	    db_client_arrived(order->client, order->now) < commander->stopped)
		return end_order(commander, order, DB_RESULT_CANCELLED);
	/* It would be sent before a stop that came before it. */
	if (!db_command_is_stop(command) && db_requests_has_stop_to_repeat(commander))
		return end_order(commander, order, DB_RESULT_BUSY);
	slot = db_requests_submit(commander, order->client, &request, order->id);
	if (!slot)
		return end_order(commander, order, DB_RESULT_BUSY);
	db_requests_take_over(commander, slot);
	if (db_command_may_move(command))
		begin_hold(commander, order, slot);
	if (db_admission_clears_latch(commander, command))
		slot->ends_trip = commander->watchdog.trips;
	if (db_command_may_move(command))
		db_watchdog_arm(&commander->watchdog, db_client_arrived(order->client, order->now));
	db_motion_note_submitted(commander, order->writer, command, order->now);
	db_account_add_command(commander, order->client, &order->block, order->id,
	                       DB_RESULT_PENDING, slot);
	commander->newest = request.ticket;
	if (order->writer && order->by_block)
		db_writer_set_executed(order->writer, &order->block, order->id, DB_RESULT_PENDING,
		                       request.ticket);
	db_writers_set_command(&commander->writers, order->writer, order->id, order->block.command,
	                       DB_RESULT_PENDING, request.ticket);
	return db_requests_wait(commander, slot, order->token, order->now);
}

/* What it repeats; null. Without a writer there is no id. */
static const struct db_used_id *find_first(const struct order *order)
{
	if (db_command_is_stop((enum db_command)order->block.command) || !order->writer)
		return NULL;
	return db_admission_find_repeated(order->writer, &order->block, order->id, order->bare);
}

static struct db_write_answer decide_order(struct db_commander *commander,
                                           const struct order *order)
{
	enum db_command command = (enum db_command)order->block.command;
	struct db_slot *under_way = NULL;
	enum db_result result;

	result = db_admission_permit(commander, order->writer, &order->block, order->id);
	if (result != DB_RESULT_OK)
		return end_order(commander, order, result);
	if (db_admission_clears_latch(commander, command) && is_only_latched(commander))
		return end_latch(commander, order);
	if (db_command_is_stop(command))
		under_way = db_requests_join_stop(commander, command);
	return under_way ? join_order(commander, order, under_way) : submit_order(commander, order);
}

static bool is_not_now(enum db_result result)
{
	return result == DB_RESULT_BUSY || result == DB_RESULT_OFFLINE ||
	       result == DB_RESULT_BUS_DOWN;
}

/*
 * What a command shows of who gave it. Who commands a drive is missed when it falls silent; who only stops it need not
 * be. What was refused commands nothing, and the same id again only shows that its writer lives when that is who commands:
 * anybody can repeat it. After a start a PLC that goes on with its last block is known by the baseline, which it repeats:
 * while nobody else commands.
 */
static void note_commander(struct db_commander *commander, const struct order *order,
                           struct db_write_answer answer, bool repeated)
{
	struct db_watchdog *watchdog = &commander->watchdog;
	bool is_baseline = !answer.later && answer.result == DB_RESULT_RESTARTED;
	bool counts = db_write_is_taken(answer) || is_baseline;
	enum db_command command = (enum db_command)order->block.command;
	db_time arrived = db_client_arrived(order->client, order->now);

	if (!order->client)
		return;
	if (repeated || is_baseline)
		counts = counts && (!db_watchdog_is_commanded(watchdog) ||
		                    db_watchdog_is_commanded_by(watchdog, order->client));
	/* Who only clears a fault or reads parameters has set nothing going. */
	if (counts && (db_command_may_move(command) || command == DB_CMD_ENABLE))
		db_watchdog_commanded(watchdog, order->client);
	if (counts && (!db_watchdog_is_commanded(watchdog) ||
	               db_watchdog_is_commanded_by(watchdog, order->client)))
		db_commander_feed(commander, order->client, DB_FEED_WRITES, arrived);
	else if (!answer.later && is_not_now(answer.result))
		db_commander_feed(commander, order->client, DB_FEED_REQUESTS, arrived);
}

static struct db_write_answer carry_out(struct db_commander *commander, const struct order *order)
{
	const struct db_used_id *first = find_first(order);
	struct db_write_answer answer;

	db_reaction_check_hold(commander, order->now);
	if (db_command_is_stop((enum db_command)order->block.command))
		db_motion_note_stop(commander, db_client_arrived(order->client, order->now));
	answer = first ? repeat_order(commander, order, first) : decide_order(commander, order);
	note_commander(commander, order, answer, first != NULL);
	return answer;
}

/* --- writes ------------------------------------------------------------------------------------------ */

/* What is staged is checked now, so that the start of a group finds no surprises. */
static struct db_write_answer stage_order(struct db_commander *commander, const struct order *order,
                                          bool beside_command)
{
	struct order staged = *order;
	enum db_result result = DB_RESULT_OUT_OF_RANGE;

	staged.id = 0;
	staged.block.command = staged.block.staged_command;
	if (!beside_command)
		result = db_admission_permit_staged(commander, staged.writer, &staged.block);
	return result == DB_RESULT_OK ? answer_now(DB_RESULT_OK) :
	                                end_order(commander, &staged, result);
}

static struct db_hold_terms hold_of_block(const struct db_command_block *block)
{
	return (struct db_hold_terms){
		.span_ms = block->hold_ms,
		.beat = block->hold_beat,
		.counted = true,
	};
}

struct db_write_answer db_commander_write(struct db_commander *commander,
                                          const struct db_client *client,
                                          const struct db_command_write *write,
                                          struct db_write_token token, db_time now)
{
	bool stages = write->has_staged && write->block.staged_command != DB_CMD_NONE;
	bool commands = write->has_command && write->block.command != DB_CMD_NONE;
	bool stops = commands && db_command_is_stop((enum db_command)write->block.command);
	struct order order = {
		.client = client,
		.block = write->block,
		.by_block = true,
		.bare = !write->has_id,
		.hold = hold_of_block(&write->block),
		.token = token,
		.now = now,
	};
	struct db_write_answer answer = answer_now(DB_RESULT_OK);

	/* Who only writes arguments takes no place from those who number their commands. */
	if (stages || commands || write->has_id)
		order.writer = db_writers_claim(&commander->writers, client, now);
	if (stages && !stops) {
		answer = stage_order(commander, &order, commands);
	} else if (commands) {
		/* Whatever else stands in the block, a stop is a stop. */
		order.id = db_admission_id(order.writer, write);
		answer = carry_out(commander, &order);
	}
	if (!db_write_is_taken(answer))
		return answer;
	commander->kept = write->block;
	if (write->has_beat && client &&
	    db_hold_count(&commander->hold, client, write->block.hold_beat,
	                  db_client_arrived(client, now), now))
		db_commander_feed(commander, client, DB_FEED_WRITES,
		                  db_client_arrived(client, now));
	if (write->has_id && order.writer)
		order.writer->kept_id = write->block.command_id;
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
	struct order order = {
		.client = client,
		.writer = db_writers_claim(&commander->writers, client, now),
		.block = commander->kept,
		.group = group,
		.token = token,
		.now = now,
	};

	order.block.command = order.block.staged_command;
	order.hold = hold_of_block(&order.block);
	commander->kept.staged_command = DB_CMD_NONE;
	return carry_out(commander, &order);
}

struct db_write_answer db_commander_execute(struct db_commander *commander,
                                            const struct db_client *client, enum db_command code,
                                            const struct db_args *args, struct db_write_token token,
                                            db_time now)
{
	return db_commander_execute_held(commander, client, code, args, 0, token, now);
}

struct db_write_answer db_commander_execute_held(struct db_commander *commander,
                                                 const struct db_client *client,
                                                 enum db_command code, const struct db_args *args,
                                                 uint32_t hold_ms, struct db_write_token token,
                                                 db_time now)
{
	struct order order = {
		.client = client,
		.writer = db_writers_claim(&commander->writers, client, now),
		.block = { .command = (uint16_t)code, .args = *args },
		.hold = { .span_ms = hold_ms, .beat = commander->kept.hold_beat },
		.token = token,
		.now = now,
	};

	return carry_out(commander, &order);
}

struct db_write_answer db_commander_set(struct db_commander *commander,
                                        const struct db_client *client,
                                        const struct db_setting *settings, size_t count,
                                        struct db_write_token token, db_time now)
{
	const struct db_driver *driver = commander->config.driver;
	struct db_writer *writer = db_writers_find(&commander->writers, client);
	enum db_result result = db_admission_permit_settings(commander, writer, settings, count);
	struct db_request request = {
		.submitted = now,
		.setting_count = (uint16_t)count,
		.settings = settings,
	};
	struct db_slot *slot = NULL;
	size_t first = settings[0].param;

	if (result == DB_RESULT_OK)
		result = db_requests_reach(commander, DB_CMD_NONE);
	if (result == DB_RESULT_OK) {
		slot = db_requests_submit(commander, client, &request, 0);
		result = slot ? DB_RESULT_PENDING : DB_RESULT_BUSY;
	}
	if (slot && client)
		db_commander_feed(commander, client, DB_FEED_WRITES,
		                  db_client_arrived(client, now));
	else if (client && is_not_now(result))
		db_commander_feed(commander, client, DB_FEED_REQUESTS,
		                  db_client_arrived(client, now));
	db_account_add_settings(commander, client, settings, result, slot);
	db_writers_set_write(&commander->writers, writer, result, 0, slot ? slot->ticket : 0);
	if (slot) {
		/* A later stop is not to join one from before this, which would leave it
		 * standing. */
		commander->newest = slot->ticket;
		return db_requests_wait(commander, slot, token, now);
	}
	db_account_log_refusal(
		commander, client,
		&(struct db_refused_write){
			.param = first < driver->param_count ? driver->params[first].name : NULL,
			.result = result,
		});
	return answer_now(result);
}

void db_commander_set_refused(struct db_commander *commander, const struct db_client *client,
                              enum db_result result, uint16_t address)
{
	db_writers_set_write(&commander->writers, db_writers_find(&commander->writers, client),
	                     result, address, 0);
	db_account_log_refusal(commander, client,
	                       &(struct db_refused_write){
				       .address = address,
				       .result = result,
			       });
}

void db_commander_refuse(struct db_commander *commander, const struct db_client *client,
                         const struct db_command_block *block, enum db_result result,
                         uint16_t address)
{
	const struct db_setting unknown = { .param = DB_HISTORY_UNKNOWN };

	db_writers_set_write(&commander->writers, db_writers_find(&commander->writers, client),
	                     result, address, 0);
	db_account_log_refusal(commander, client,
	                       &(struct db_refused_write){
				       .command = (enum db_command)block->command,
				       .result = result,
			       });
	if (block->command == DB_CMD_NONE)
		db_account_add_settings(commander, client, &unknown, result, NULL);
	else
		db_account_add_command(commander, client, block, block->command_id, result, NULL);
}

/* --- clients ----------------------------------------------------------------------------------------- */

void db_commander_hear(struct db_commander *commander, const struct db_client *client, db_time now)
{
	db_writers_hear(&commander->writers, client, now);
}

void db_commander_feed(struct db_commander *commander, const struct db_client *client,
                       enum db_watchdog_feed by, db_time arrived)
{
	if (db_watchdog_feed(&commander->watchdog, by, client, arrived))
		commander->fed_by = *client;
}

const struct db_client *db_commander_fed_by(const struct db_commander *commander)
{
	return &commander->fed_by;
}

void db_commander_set_watchdog(struct db_commander *commander, uint32_t timeout_ms, db_time arrived)
{
	db_watchdog_set(&commander->watchdog, timeout_ms, arrived);
}

bool db_commander_beat(struct db_commander *commander, const struct db_client *client, db_time now)
{
	return db_hold_beat(&commander->hold, client, db_client_arrived(client, now), now);
}

void db_commander_desert(struct db_commander *commander, const struct db_client *client,
                         db_time now)
{
	db_hold_desert(&commander->hold, client, now);
}

void db_commander_forget(struct db_commander *commander, const struct db_client *client,
                         db_time now)
{
	db_commander_desert(commander, client, now);
	db_watchdog_forget(&commander->watchdog, client->id);
}

enum db_command db_commander_owed_stop(const struct db_commander *commander)
{
	bool held = db_hold_deadline(&commander->hold) != DB_TIME_NEVER;
	enum db_command owed = held ? DB_CMD_STOP : DB_CMD_NONE;

	for (const struct db_slot *slot = commander->pending.first; slot; slot = slot->next) {
		if (slot->command == DB_CMD_DISABLE)
			return DB_CMD_DISABLE;
		if (db_command_is_stop(slot->command))
			owed = slot->command;
	}
	return owed;
}

void db_commander_end_hold(struct db_commander *commander, db_time now)
{
	struct db_client holder = commander->hold.holder;

	db_hold_desert(&commander->hold, &holder, now);
	db_reaction_check_hold(commander, now);
}

void db_commander_stand(struct db_commander *commander, enum db_command stop,
                        enum db_stand_cause cause, db_time now)
{
	db_reaction_stand(commander, stop, cause, now);
}

/* --- time and the bus ---------------------------------------------------------------------------------- */

void db_commander_complete(struct db_commander *commander, const struct db_completion *completion,
                           db_time now)
{
	struct db_slot *slot = db_requests_find(commander, completion->ticket);
	/* To the confirmation itself, not to when this thread came to hear of it. */
	db_time end = completion->finished ? completion->finished : now;
	struct db_client client;

	if (!slot)
		return;
	if (slot->again) {
		db_requests_repeat_stop(commander, slot, now);
		return;
	}
	db_writers_complete(&commander->writers, completion->ticket, completion->result,
	                    db_time_us32(end - slot->arrived));
	db_motion_note_ended(commander, slot, completion->result, end);
	if (slot->ends_trip != 0 && slot->ends_trip == commander->watchdog.trips &&
	    db_result_is_success(completion->result))
		db_reaction_unlatch(commander, now);
	db_account_log_refusal(commander, db_slot_client(slot, &client),
	                       &(struct db_refused_write){
				       .command = slot->command,
				       .result = completion->result,
			       });
	db_requests_end(commander, slot, completion->result);
}

db_time db_commander_next_deadline(const struct db_commander *commander)
{
	db_time reaction = db_reaction_deadline(commander);
	db_time motion = db_motion_deadline(commander);
	db_time requests = db_requests_deadline(commander);
	db_time next = reaction < motion ? reaction : motion;

	return requests < next ? requests : next;
}

bool db_commander_expire(struct db_commander *commander, db_time now)
{
	bool tripped = db_reaction_run(commander, now);

	db_motion_check(commander, now);
	db_requests_expire(commander, now);
	return tripped;
}

/* --- what is shown ------------------------------------------------------------------------------------- */

uint32_t db_commander_newest(const struct db_commander *commander)
{
	return commander->newest;
}

bool db_commander_history(const struct db_commander *commander, size_t age,
                          struct db_history_entry *entry)
{
	return db_history_get(&commander->history, age, entry);
}

enum db_result db_commander_outcome(const struct db_commander *commander, uint32_t entry)
{
	uint32_t age = commander->history.count - entry;
	struct db_history_entry found;

	if (commander->follow.active && commander->follow_entry == entry &&
	    db_follow_has_end(commander->follow.command))
		return DB_RESULT_PENDING;
	if (!db_history_get(&commander->history, age, &found) || found.sequence != entry)
		return DB_RESULT_INDETERMINATE;
	return (enum db_result)found.result;
}

struct db_command_block db_commander_kept(struct db_commander *commander,
                                          const struct db_client *client)
{
	const struct db_writer *writer = db_writers_find(&commander->writers, client);
	struct db_command_block block = commander->kept;

	block.command_id = writer ? writer->kept_id : 0;
	return block;
}

void db_commander_state(struct db_commander *commander, const struct db_client *client,
                        struct db_command_state *state, db_time now)
{
	const struct db_watchdog *watchdog = &commander->watchdog;
	uint32_t oldest = 0;

	*state = (struct db_command_state){
		.results = *db_writers_results(&commander->writers, client),
		.active_command = DB_CMD_NONE,
		.busy = commander->pending.first != NULL,
		.latched = watchdog->latched,
		.latched_since = watchdog->latched_at,
		.watchdog_ms = watchdog->timeout_ms,
		.watchdog_remaining_ms = db_watchdog_remaining_ms(watchdog, now),
		.watchdog_trips = watchdog->trips,
	};
	for (const struct db_slot *slot = commander->pending.first; slot; slot = slot->next) {
		uint32_t age = commander->submitted - slot->order;

		if (slot->command != DB_CMD_NONE && age > oldest) {
			oldest = age;
			state->active_command = (uint16_t)slot->command;
		}
	}
}
