/* SPDX-License-Identifier: Apache-2.0 */
#include "server/peers.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <string.h>
#include <cmocka.h>

#define S DB_NS_PER_S
#define START (1000 * S)
#define CONNECTIONS 3

struct told {
	unsigned lines;
	uint8_t last; /* byte of the address */
	enum db_refusal kind;
	uint32_t count;
	bool first;
};

static void tell(void *context, const uint8_t address[16], enum db_refusal kind, uint32_t count,
                 bool first)
{
	struct told *told = context;

	told->lines++;
	told->last = address[15];
	told->kind = kind;
	told->count = count;
	told->first = first;
}

static const uint8_t *address(uint32_t number)
{
	static uint8_t bytes[16];

	memset(bytes, 0, sizeof bytes);
	bytes[14] = (uint8_t)(number >> 8);
	bytes[15] = (uint8_t)number;
	return bytes;
}

#define PEERS()                                                          \
	struct told told = { 0 };                                        \
	struct db_peers *peers = db_peers_new(CONNECTIONS, tell, &told); \
	(void)state;                                                     \
	assert_non_null(peers)

static void refuse(struct db_peers *peers, uint32_t who, enum db_refusal kind, db_time now)
{
	db_peers_refused(peers, db_peers_find(peers, address(who), now), kind, now);
}

static void each_kind_is_told_once(void **state)
{
	PEERS();
	for (int i = 0; i < 100; i++) {
		refuse(peers, 1, DB_REFUSED_WRITE, START + i);
		refuse(peers, 1, DB_REFUSED_PACE, START + i);
		refuse(peers, 2, DB_REFUSED_WRITE, START + i);
	}
	assert_int_equal(told.lines, 3);
	assert_true(told.first);
	assert_int_equal(told.count, 1);
	free(peers);
}

static void the_rest_is_told_by_its_count(void **state)
{
	PEERS();
	assert_true(db_peers_deadline(peers) == DB_TIME_NEVER);
	refuse(peers, 7, DB_REFUSED_ADDRESS, START);
	assert_true(db_peers_deadline(peers) == DB_TIME_NEVER);
	refuse(peers, 7, DB_REFUSED_ADDRESS, START + S);
	refuse(peers, 7, DB_REFUSED_ADDRESS, START + 2 * S);
	assert_int_equal(told.lines, 1);
	assert_true(db_peers_deadline(peers) == START + 60 * S);
	db_peers_log(peers, START + 60 * S - 1);
	assert_int_equal(told.lines, 1);
	db_peers_log(peers, START + 60 * S);
	assert_int_equal(told.lines, 2);
	assert_int_equal(told.last, 7);
	assert_int_equal(told.kind, DB_REFUSED_ADDRESS);
	assert_int_equal(told.count, 2);
	assert_false(told.first);
	/* Nothing happened since: nothing to tell. */
	assert_true(db_peers_deadline(peers) == DB_TIME_NEVER);
	db_peers_log(peers, START + 600 * S);
	assert_int_equal(told.lines, 2);
	free(peers);
}

/* Somebody who knocks every second for a day is told of 30 times or so, with nothing left out. */
static void patience_grows(void **state)
{
	uint32_t sum = 0;
	unsigned lines = 0;

	PEERS();
	for (db_time now = START; now < START + 86400 * S; now += S) {
		db_peers_log(peers, now);
		refuse(peers, 7, DB_REFUSED_FULL, now);
		if (told.lines > lines)
			sum += told.count;
		lines = told.lines;
	}
	assert_in_range(lines, 24, 32);
	assert_in_range(sum, 86400 - 3600, 86400);
	free(peers);
}

static void many_addresses_do_not_flood_the_log(void **state)
{
	PEERS();
	for (uint32_t i = 0; i < 5000; i++)
		refuse(peers, i, DB_REFUSED_ADDRESS, START + i * (S / 1000));
	assert_int_equal(told.lines, DB_PEERS_MESSAGES);
	/* Those that are still remembered come when there is room again. */
	assert_true(db_peers_deadline(peers) == START + 60 * S);
	db_peers_log(peers, START + 60 * S);
	assert_int_equal(told.lines, 2 * DB_PEERS_MESSAGES);
	assert_true(told.first);
	free(peers);
}

static void connected_peers_stay(void **state)
{
	struct db_peer *peer;

	PEERS();
	for (uint32_t i = 0; i < CONNECTIONS; i++) {
		peer = db_peers_find(peers, address(i), START);
		assert_memory_equal(peer->address, address(i), 16);
		peer->connections = i + 1;
	}
	for (uint32_t i = 1000; i < 1000 + 10 * DB_PEERS_SPARE; i++)
		db_peers_find(peers, address(i), START + i);
	for (uint32_t i = 0; i < CONNECTIONS; i++)
		assert_int_equal(db_peers_find(peers, address(i), START)->connections, i + 1);
	/* The newest strangers are remembered, too. */
	peer = db_peers_find(peers, address(1000 + 10 * DB_PEERS_SPARE - 1), START + 2000);
	peer->refusals[0].unlogged = 9;
	db_peers_find(peers, address(1), START + 3000);
	assert_int_equal(db_peers_find(peers, address(1000 + 10 * DB_PEERS_SPARE - 1), START + 4000)
	                         ->refusals[0]
	                         .unlogged,
	                 9);
	free(peers);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(each_kind_is_told_once),
		cmocka_unit_test(the_rest_is_told_by_its_count),
		cmocka_unit_test(patience_grows),
		cmocka_unit_test(many_addresses_do_not_flood_the_log),
		cmocka_unit_test(connected_peers_stay),
	};

	return cmocka_run_group_tests_name("server/peers", tests, NULL, NULL);
}
