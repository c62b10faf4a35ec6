/* SPDX-License-Identifier: Apache-2.0 */
#include "web/order.h"

enum db_web_turn db_web_order_take(struct db_web_order *order, uint64_t number)
{
	uint64_t ahead = number > order->highest ? number - order->highest : 0;
	uint64_t behind = ahead > 0 ? 0 : order->highest - number;

	if (ahead > 0) {
		order->seen = ahead < DB_WEB_ORDER_WINDOW ? order->seen << ahead : 0;
		order->highest = number;
	}
	if (behind >= DB_WEB_ORDER_WINDOW || order->seen >> behind & 1)
		return DB_WEB_TURN_REPEATED;
	order->seen |= UINT64_C(1) << behind;
	return db_web_order_is_overtaken(order, number) ? DB_WEB_TURN_OVERTAKEN : DB_WEB_TURN_NOW;
}

void db_web_order_stop(struct db_web_order *order, uint64_t number)
{
	if (number > order->stopped)
		order->stopped = number;
}
